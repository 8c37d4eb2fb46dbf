#pragma once

#include <string>

#include "taclink/v1/contacts.pb.h"

namespace taclink::command {

/// One line of JSON.
std::string ContactsJson(const v1::StreamContactsResponse& arm);
/// A table of the contacts and a line of joint torques.
std::string ContactsTable(const v1::StreamContactsResponse& arm);

}  // namespace taclink::command
