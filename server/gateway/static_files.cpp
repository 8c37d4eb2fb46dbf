#include "server/gateway/static_files.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <span>

#include "sensing/core/embedded_file.h"
#include "server/gateway/http_target.h"

namespace taclink {
std::span<const EmbeddedFile> EmbeddedWeb();
}

namespace taclink::server {
namespace {

namespace fs = std::filesystem;

Error NotFound(const std::string& path) {
  return {ErrorCode::kNotFound, "there is no " + path + " here"};
}

}  // namespace

std::string StaticFile::Read(size_t count) {
  std::string out;
  if (!content.empty()) {
    out = content.substr(taken_, count);
  } else {
    out.resize(std::min<uint64_t>(count, size - taken_));
    stream.read(out.data(), static_cast<std::streamsize>(out.size()));
    out.resize(static_cast<size_t>(stream.gcount()));
  }
  taken_ += out.size();
  return out;
}

Result<StaticFiles> StaticFiles::Open(const std::string& root) {
  StaticFiles out;
  if (root.empty()) return out;
  std::error_code error;
  out.root_ = fs::canonical(root, error).string();
  if (error || !fs::is_regular_file(out.root_ + "/index.html", error))
    return Error{ErrorCode::kNotFound, "http.web_root " + root +
                                           " is no folder with an index.html; build the web page or leave "
                                           "it out for the one built in"};
  return out;
}

Result<StaticFile> StaticFiles::FindBuiltIn(std::string_view name, bool gzip) {
  const std::string compressed = std::string(name) + ".gz";
  for (const EmbeddedFile& file : EmbeddedWeb()) {
    if (file.name != (gzip ? compressed : name)) continue;
    StaticFile out;
    out.type = ContentTypeOf(name);
    out.gzip = gzip;
    out.size = file.content.size();
    out.tag = std::to_string(std::hash<std::string_view>()(file.content));
    out.content = file.content;
    return out;
  }
  if (gzip) return FindBuiltIn(name, false);
  return NotFound("/" + std::string(name));
}

Result<StaticFile> StaticFiles::Find(const std::string& path, bool gzip) const {
  const std::string name = path == "/" ? "index.html" : path.substr(1);
  if (root_.empty()) return FindBuiltIn(name, gzip);
  std::error_code error;
  const fs::path file = fs::canonical(fs::path(root_) / name, error);
  if (error || !file.string().starts_with(root_ + "/") || !fs::is_regular_file(file, error))
    return NotFound(path);
  StaticFile out;
  out.type = ContentTypeOf(name);
  out.size = fs::file_size(file, error);
  const auto changed = fs::last_write_time(file, error).time_since_epoch().count();
  out.tag = std::to_string(out.size) + "-" + std::to_string(changed);
  out.never_changes = NameHoldsHash(name);
  out.stream.open(file, std::ios::binary);
  if (error || !out.stream) return NotFound(path);
  return out;
}

}  // namespace taclink::server
