// Tables and lines of numbers that programs write for `taclink`: the first byte says which.
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <string>

#include "client/command/live/joint_lines.h"
#include "client/command/offline/marker_csv.h"
#include "client/command/offline/probe_csv.h"
#include "sensing/model/model_file.h"
#include "server/pressure/line_reader.h"

namespace {

using taclink::LinkModel;

/// A file in memory, for readers that want a path.
class MemoryFile {
 public:
  explicit MemoryFile(std::string_view bytes) : descriptor_(memfd_create("table", MFD_CLOEXEC)) {
    if (descriptor_ < 0 ||
        write(descriptor_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size()))
      std::abort();
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  const int descriptor_;
};

template <typename T>
void MustSayWhy(const taclink::Result<T>& result) {
  if (!result.ok() && result.error().message.empty()) std::abort();
}

void ReadJoints(std::string_view text) {
  taclink::command::JointLineReader reader;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    const auto read = reader.Read(line);
    MustSayWhy(read);
    if (read.ok() && *read && (*read)->positions.size() != (*read)->names.size()) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const LinkModel model = *taclink::LoadLinkModel("cylinder");
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0] % 4) {
    case 0:
      MustSayWhy(taclink::command::ReadMarkerCsv(MemoryFile(text).path(), model, std::nullopt));
      break;
    case 1:
      MustSayWhy(taclink::command::ReadProbeCsv(MemoryFile(text).path(), model, 10));
      break;
    case 2:
      ReadJoints(text);
      break;
    default:
      if (const auto number = taclink::server::NumberOfLine(text); number && !std::isfinite(*number))
        std::abort();
  }
  return 0;
}
