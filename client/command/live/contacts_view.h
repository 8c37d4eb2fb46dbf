#pragma once

#include <string>

#include "client/cpp/taclink/arm_contacts.h"

namespace taclink::command {

/// One line of JSON.
std::string ContactsJson(const client::ArmContacts& arm);
/// A table of the contacts and a line of joint torques.
std::string ContactsTable(const client::ArmContacts& arm);

}  // namespace taclink::command
