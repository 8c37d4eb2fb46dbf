#include "client/command/logs/solve_log.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "client/command/cli/link_crew.h"
#include "client/command/logs/solve_log_link.h"
#include "client/command/logs/solve_log_output.h"
#include "mcap/cursor.h"
#include "taclink/v1/arm.pb.h"
#include "taclink/v1/log.pb.h"
#include "wire/convert.h"
#include "wire/log/topics.h"

namespace taclink::command {
namespace {

using wire::log::Topic;
using wire::log::TopicKind;
using Shared = std::shared_ptr<const std::string>;

// Of what was read and is not written yet; pictures, for the most part.
constexpr uint64_t kHeldBytes = uint64_t{128} << 20;

Error In(const std::string& file, Error error) {
  error.message = file + ": " + error.message;
  return error;
}

Error Damaged(const std::string& file, const std::string& why) {
  return {ErrorCode::kInvalidArgument,
          file + ": damaged, or not closed: " + why +
              "; frames that are missing would change those after them. 'taclink log recover' saves what is "
              "intact, and that can be solved"};
}

int Jobs(int wanted, size_t links) {
  const int all = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return std::min(wanted > 0 ? wanted : all, static_cast<int>(links));
}

/// One run over a log.
class LogSolver {
 public:
  LogSolver(const SolveLogOptions& options, const mcap::Reader& log, std::vector<LinkSettings> settings)
      : options_(options), log_(log), settings_(std::move(settings)) {
    for (size_t link = 0; link < settings_.size(); ++link) {
      solvers_.push_back(std::make_unique<LogLinkSolver>(settings_[link], HasPictures(settings_[link].name)));
      new_models_ = new_models_ || settings_[link].new_model.has_value();
    }
    pending_.resize(settings_.size());
    jobs_ = Jobs(options.jobs, settings_.size());
    crew_ = std::make_unique<LinkCrew>(settings_.size(), static_cast<size_t>(jobs_));
  }

  Result<void> Run(const SolveProgress& progress);
  SolveLogSummary Summary() const;

 private:
  /// What to do with the messages of a channel.
  struct Route {
    std::optional<Topic> topic;
    std::optional<size_t> link;  // that is solved
    std::string type;
  };
  struct PendingPictures {
    uint32_t sequence = 0;
    RecordedPictures pictures;
  };

  bool HasPictures(const std::string& link) const;
  void FindRoutes();
  Result<void> Take(const mcap::Message& message);
  void TakePicture(const Route& route, uint32_t sequence, const Shared& bytes);
  void TakeFrame(size_t link, const mcap::Message& message, Shared bytes);
  void CountLosses(const std::string& bytes);
  Shared WithNewModels(Shared arm) const;
  uint64_t Frames() const;

  // Constant after construction.
  const SolveLogOptions& options_;
  const mcap::Reader& log_;
  const std::vector<LinkSettings> settings_;
  std::map<uint16_t, Route> routes_;  // by channel
  bool new_models_ = false;
  int jobs_ = 1;

  std::vector<std::unique_ptr<LogLinkSolver>> solvers_;  // by link; used by the crew
  std::map<std::string, uint64_t> lost_;                 // by the link's name
  std::vector<PendingPictures> pending_;                 // by link: of the frame that comes next
  std::unique_ptr<SolvedLog> out_;
  uint64_t bytes_ = 0;
  std::unique_ptr<LinkCrew> crew_;  // ends before what it uses
};

bool LogSolver::HasPictures(const std::string& link) const {
  return std::any_of(log_.channels().begin(), log_.channels().end(), [&](const auto& entry) {
    const auto topic = wire::log::ParseTopic(entry.second.topic);
    const auto& counts = log_.statistics().channel_message_counts;
    const auto count = counts.find(entry.first);
    return topic && topic->kind == TopicKind::kPicture && topic->link == link && count != counts.end() &&
           count->second > 0;
  });
}

void LogSolver::FindRoutes() {
  for (const auto& [id, channel] : log_.channels()) {
    Route route{.topic = wire::log::ParseTopic(channel.topic), .link = {}, .type = {}};
    for (size_t link = 0; route.topic && link < settings_.size(); ++link) {
      if (settings_[link].name == route.topic->link) route.link = link;
    }
    if (const auto schema = log_.schemas().find(channel.schema_id); schema != log_.schemas().end())
      route.type = schema->second.name;
    routes_.emplace(id, std::move(route));
  }
}

Result<void> LogSolver::Run(const SolveProgress& progress) {
  FindRoutes();
  auto out = SolvedLog::Create(options_, log_, settings_);
  if (!out) return out.error();
  out_ = std::move(*out);
  const uint64_t all = log_.statistics().message_count;
  uint64_t taken = 0;
  mcap::MessageCursor cursor(log_, {.order = mcap::MessageOrder::kFile});
  while (true) {
    const auto message = cursor.Next();
    if (!message && message.error().code == ErrorCode::kEndOfData) break;
    if (!message) return Damaged(options_.input, message.error().message);
    if (auto done = Take(*message); !done) return done.error();
    if (auto written = out_->WriteDown(kHeldBytes); !written) return written.error();
    progress(++taken - out_->waiting(), all);
  }
  while (out_->waiting() > 0) {
    if (auto written = out_->WriteOne(); !written) return written.error();
    progress(taken - out_->waiting(), all);
  }
  if (auto closed = out_->Close(Frames()); !closed) return closed.error();
  bytes_ = out_->bytes();
  return {};
}

Result<void> LogSolver::Take(const mcap::Message& message) {
  const Route& route = routes_.at(message.channel_id);
  const TopicKind kind = route.topic ? route.topic->kind : TopicKind::kTransforms;  // copied as well
  if (kind == TopicKind::kContacts || kind == TopicKind::kEvents) return {};
  auto bytes = std::make_shared<const std::string>(reinterpret_cast<const char*>(message.data.data()),
                                                   message.data.size());
  if (route.link && kind == TopicKind::kFrame) {
    TakeFrame(*route.link, message, std::move(bytes));
    return {};
  }
  if (route.link && kind == TopicKind::kScene) {
    auto scene = [solver = solvers_[*route.link].get(), at = static_cast<int64_t>(message.log_time_ns)] {
      return Result<std::string>(solver->Scene(at));
    };
    out_->Add(message, crew_->Post(*route.link, std::move(scene)), 0);
    return {};
  }
  if (kind == TopicKind::kPicture) {
    if (route.link) TakePicture(route, message.sequence, bytes);
    if (!options_.pictures) return {};
  }
  if (kind == TopicKind::kLosses) CountLosses(*bytes);
  if (kind == TopicKind::kArm && new_models_) bytes = WithNewModels(std::move(bytes));
  out_->Add(message, std::move(bytes));
  return {};
}

void LogSolver::TakePicture(const Route& route, uint32_t sequence, const Shared& bytes) {
  PendingPictures& pending = pending_[*route.link];
  if (pending.sequence != sequence) pending = {.sequence = sequence, .pictures = {}};
  pending.pictures[Index(route.topic->camera)] = RecordedPicture{route.type, bytes};
}

void LogSolver::TakeFrame(size_t link, const mcap::Message& message, Shared bytes) {
  PendingPictures& pending = pending_[link];
  RecordedPictures pictures;
  if (pending.sequence == message.sequence) pictures = std::exchange(pending.pictures, {});
  uint64_t held = bytes->size();
  for (const auto& picture : pictures) held += picture ? picture->bytes->size() : 0;
  auto work = [solver = solvers_[link].get(), bytes = std::move(bytes), pictures = std::move(pictures)] {
    return solver->Solve(*bytes, pictures);
  };
  out_->Add(message, crew_->Post(link, std::move(work)), held);
}

void LogSolver::CountLosses(const std::string& bytes) {
  v1::RecordingLoss loss;
  if (loss.ParseFromString(bytes)) lost_[loss.link()] += loss.count();
}

Shared LogSolver::WithNewModels(Shared arm) const {
  v1::Arm message;
  if (!message.ParseFromString(*arm)) return arm;
  for (v1::Link& link : *message.mutable_links()) {
    for (const LinkSettings& settings : settings_) {
      if (settings.name != link.name() || !settings.new_model) continue;
      link.clear_model();
      wire::Fill(settings.model, *link.mutable_model());
    }
  }
  return std::make_shared<const std::string>(message.SerializeAsString());
}

uint64_t LogSolver::Frames() const {
  uint64_t frames = 0;
  for (const auto& [id, route] : routes_) {
    const auto& counts = log_.statistics().channel_message_counts;
    if (route.topic && route.topic->kind == TopicKind::kFrame && counts.contains(id)) frames += counts.at(id);
  }
  return frames;
}

SolveLogSummary LogSolver::Summary() const {
  const mcap::Statistics& statistics = log_.statistics();
  SolveLogSummary summary{
      .links = {},
      .recorded_s = static_cast<double>(statistics.message_end_ns - statistics.message_start_ns) * 1e-9,
      .wall_s = 0,
      .jobs = jobs_,
      .bytes = bytes_};
  for (const auto& solver : solvers_) {
    LinkReport& link = summary.links.emplace_back(solver->report());
    if (const auto lost = lost_.find(link.name); lost != lost_.end()) link.lost = lost->second;
  }
  return summary;
}

}  // namespace

Result<SolveLogSummary> SolveLog(const SolveLogOptions& options, const SolveProgress& progress) {
  const auto start = std::chrono::steady_clock::now();
  auto source = mcap::FileSource::Open(options.input);
  if (!source) return source.error();
  const auto log = mcap::Reader::Open(std::shared_ptr<const mcap::ByteSource>(std::move(*source)));
  if (!log) return In(options.input, log.error());
  if (!(*log)->summary_problem().empty()) return Damaged(options.input, (*log)->summary_problem());
  auto settings = FindSettings(**log, options);
  if (!settings) return settings.error();
  LogSolver solver(options, **log, std::move(*settings));
  if (auto run = solver.Run(progress); !run) return run.error();
  SolveLogSummary summary = solver.Summary();
  summary.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace taclink::command
