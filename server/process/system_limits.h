#pragma once

#include <exception>
#include <string>

namespace taclink::server {

/// What ended a thread or a call: where a limit of the system did (threads, descriptors, memory), which one,
/// its value as far as it can be read, and how to raise it; else what `error` says. For std::bad_alloc, and
/// system errors of the standard library and of Boost: of these EAGAIN is a thread that could not be started.
std::string DescribeLimit(const std::exception& error);

}  // namespace taclink::server
