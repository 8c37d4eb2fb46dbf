"""Messages and services of the protocol, generated from proto/taclink/v1 when the package is built."""
