import { readFileSync } from "node:fs";

import grpc from "@grpc/grpc-js";

// Written out, so that no name that only looks like such an address is taken for this machine.
const THIS_MACHINE = [/^unix:/, /^localhost:\d+$/, /^127\.\d{1,3}\.\d{1,3}\.\d{1,3}:\d+$/, /^\[::1\]:\d+$/];

/** Of HOST:PORT. */
export function staysHere(server) {
  return THIS_MACHINE.some((pattern) => pattern.test(server));
}

/** Of a file; throws one line. */
export function read(path) {
  try {
    return readFileSync(path);
  } catch (error) {
    throw new Error(`${path} cannot be read (${error.code}); check the path`);
  }
}

/** Credentials of a channel. Throws where a file is missing or the options do not fit each other. */
export function channelCredentials({ tlsCa, tlsCertificate, tlsKey }) {
  if (Boolean(tlsCertificate) !== Boolean(tlsKey)) {
    throw new Error("a client's certificate and its key need each other");
  }
  if (!tlsCa) {
    if (!tlsKey) return grpc.credentials.createInsecure();
    throw new Error("a client's certificate needs TLS: say with --tls-ca whom to trust as the server");
  }
  const key = tlsKey ? read(tlsKey) : null;
  const certificate = tlsCertificate ? read(tlsCertificate) : null;
  return grpc.credentials.createSsl(read(tlsCa), key, certificate);
}

/** What goes with every call. Throws where a token would go in the clear to another machine. */
export function callMetadata({ server, token, tlsCa }) {
  const metadata = new grpc.Metadata();
  if (!token) return metadata;
  if (!tlsCa && !staysHere(server)) {
    throw new Error(`the token would go to ${server} in the clear; use TLS (--tls-ca)`);
  }
  metadata.set("authorization", `Bearer ${token}`);
  return metadata;
}
