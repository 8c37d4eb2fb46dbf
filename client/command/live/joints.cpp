#include <fmt/format.h>

#include <iostream>
#include <memory>
#include <sstream>
#include <thread>
#include <utility>

#include "client/command/cli/commands.h"
#include "client/command/live/connect.h"
#include "client/command/live/joint_lines.h"
#include "client/cpp/taclink/arm_contacts.h"
#include "sensing/core/read_file.h"

namespace taclink::command {
namespace {

using std::chrono::nanoseconds;
using std::chrono::system_clock;

struct JointsOptions {
  std::string server = "127.0.0.1:50051";
  std::string file;
  bool loop = false;
};

int64_t UtcNs(system_clock::time_point time) {
  return std::chrono::duration_cast<nanoseconds>(time.time_since_epoch()).count();
}

/// Sends lines at their times: the first one's is now, the others follow as they say.
class Player {
 public:
  explicit Player(client::JointStateWriter& writer) : writer_(writer) {}

  Result<void> Play(std::istream& in) {
    JointLineReader reader;
    begun_ = false;
    for (std::string line; ReadLine(in, line);) {
      const auto read = reader.Read(line);
      if (!read) return read.error();
      if (!*read) continue;
      if (const auto sent = Send(**read); !sent) return sent.error();
    }
    return {};
  }

  size_t sent() const { return sent_; }

 private:
  /// As std::getline, but of a line that is too long no more than the reader needs to refuse it.
  static bool ReadLine(std::istream& in, std::string& line) {
    line.clear();
    for (int c = in.get(); c != std::istream::traits_type::eof(); c = in.get()) {
      if (c == '\n') return true;
      line.push_back(static_cast<char>(c));
      if (line.size() > kLongestJointLine) return true;
    }
    return !line.empty();
  }
  Result<void> Send(const JointLine& line) {
    auto time = system_clock::now();
    if (line.time_s) {
      if (!std::exchange(begun_, true)) begin_ = time - Duration(*line.time_s);
      time = begin_ + Duration(*line.time_s);
      std::this_thread::sleep_until(time);
    }
    ++sent_;
    v1::UpdateJointStatesRequest states;
    states.mutable_names()->Assign(line.names.begin(), line.names.end());
    states.mutable_positions()->Assign(line.positions.begin(), line.positions.end());
    states.mutable_velocities()->Assign(line.velocities.begin(), line.velocities.end());
    states.set_utc_ns(UtcNs(time));
    return writer_.Write(states);
  }
  static system_clock::duration Duration(double seconds) {
    return std::chrono::duration_cast<system_clock::duration>(std::chrono::duration<double>(seconds));
  }

  client::JointStateWriter& writer_;
  system_clock::time_point begin_;  // of the lines' times, once begun_
  bool begun_ = false;
  size_t sent_ = 0;
};

Result<void> RunJoints(const JointsOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  const auto writer = connection->UpdateJointStates();
  Player player(*writer);
  do {
    std::istringstream file;
    if (options.file != "-") {
      auto text = ReadText(options.file, kMostTableBytes);
      if (!text) return text.error();
      file.str(*std::move(text));
    }
    const auto played = player.Play(options.file == "-" ? std::cin : file);
    if (!played) return Error{played.error().code, options.file + ": " + played.error().message};
    if (player.sent() == 0) return Error{ErrorCode::kInvalidArgument, options.file + ": no joint positions"};
  } while (options.loop && options.file != "-");
  const auto summary = writer->Finish();
  if (!summary) return summary.error();
  fmt::print("{} joint states accepted, {} refused{}\n", summary->accepted(), summary->refused(),
             summary->first_refusal().empty() ? "" : ": " + summary->first_refusal());
  return {};
}

}  // namespace

void AddJoints(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<JointsOptions>();
  const Arguments command = app.AddCommand("joints", "Tell a server where the arm's joints are");
  AddServerOption(command, options->server);
  command
      .AddOption(
          "file", options->file,
          "Lines of joint positions, '-' for the standard input: CSV with a first line "
          "'time_s,JOINT,...', or JSON {\"time_s\": 0.1, \"positions\": {\"JOINT\": 0.5}}, or \"names\" and "
          "\"positions\" as two lists. rad, m; "
          "without time_s each line is of the moment it is read")
      .Required();
  command.AddFlag("--loop", options->loop, "Begin again at the file's end");
  command.OnChosen([options, &selected] { selected = [options] { return RunJoints(*options); }; });
}

}  // namespace taclink::command
