#include "server/security/secret_file.h"

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <vector>

#include "sensing/core/read_file.h"

namespace taclink::server {
namespace {

bool IsOwnGroup(gid_t group) {
  if (group == 0 || group == getegid()) return true;
  const int count = getgroups(0, nullptr);
  std::vector<gid_t> groups(static_cast<size_t>(std::max(count, 0)));
  const int filled = getgroups(count, groups.data());
  return std::find(groups.begin(), groups.begin() + std::max(filled, 0), group) !=
         groups.begin() + std::max(filled, 0);
}

std::string GroupName(gid_t id) {
  group entry{};
  group* found = nullptr;
  std::array<char, 4096> text{};
  if (getgrgid_r(id, &entry, text.data(), text.size(), &found) == 0 && found != nullptr)
    return found->gr_name;
  return std::to_string(id);
}

Error Refusal(const std::string& what, const std::string& path, mode_t mode, const std::string& why) {
  std::array<char, 8> octal{};
  std::snprintf(octal.data(), octal.size(), "%04o", mode & 07777U);
  return {ErrorCode::kPermissionDenied,
          what + " " + path + " is refused (mode " + octal.data() + "): " + why};
}

}  // namespace

Result<void> CheckSecretFile(const std::string& what, const std::string& path) {
  struct stat info{};
  if (stat(path.c_str(), &info) != 0) {
    const Error error = FileError(path, errno);
    return Error{error.code, what + " " + error.message};
  }
  if ((info.st_mode & S_IRWXO) != 0)
    return Refusal(
        what, path, info.st_mode,
        "every user of this machine may use it; chmod 640 it, or, where it is mounted from a secret of "
        "Kubernetes, give that volume defaultMode: 0440 and the pod an fsGroup");
  if ((info.st_mode & S_IRWXG) != 0 && !IsOwnGroup(info.st_gid))
    return Refusal(
        what, path, info.st_mode,
        "the group " + GroupName(info.st_gid) +
            ", which the server is not in, may use it; chmod 600 it, or chgrp it to the server's group");
  return {};
}

Result<std::string> ReadSecretFile(const std::string& what, const std::string& path) {
  if (const auto good = CheckSecretFile(what, path); !good) return good.error();
  return ReadSecurityFile(what, path);
}

Result<std::string> ReadSecurityFile(const std::string& what, const std::string& path) {
  auto text = ReadText(path);
  if (!text) return Error{text.error().code, what + " " + text.error().message};
  return text;
}

}  // namespace taclink::server
