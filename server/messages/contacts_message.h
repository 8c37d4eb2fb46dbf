#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/arm/arm_contacts.h"
#include "taclink/v1/contacts.pb.h"

namespace taclink::server {

v1::PoseValidity ToWire(PoseValidity validity);

/// All but sequence and time. `newest` by link; null: that link has published nothing yet.
void Fill(const std::vector<std::shared_ptr<const LinkContacts>>& newest,
          const std::vector<std::string>& link_names, const ArmPoses& poses, v1::StreamContactsResponse& out);

}  // namespace taclink::server
