#include "server/acceptance/acceptance_store.h"

#include <fcntl.h>
#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "sensing/acceptance/report_html.h"
#include "sensing/core/printable.h"
#include "sensing/core/read_file.h"
#include "sensing/core/utc_time.h"
#include "server/process/replace_file.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kNsPerS = 1'000'000'000;

Result<std::string> JsonOf(const v1::Acceptance& message) {
  std::string json;
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  const auto made = google::protobuf::util::MessageToJsonString(message, &json, options);
  if (!made.ok()) {
    return Error{ErrorCode::kInvalidArgument,
                 "the acceptance cannot be written as JSON: " + std::string(made.message())};
  }
  return json;
}

// A file that does not exist counts as removed.
Result<void> Remove(const std::string& path) {
  std::error_code error;
  fs::remove(path, error);
  if (error) return Error{ErrorCode::kUnavailable, "cannot remove " + path + ": " + error.message()};
  return {};
}

v1::Acceptance MessageOf(const AcceptanceRecord& record, const std::string& plan_text) {
  v1::Acceptance message;
  server::Fill(record, message);
  message.set_plan_text(plan_text);
  return message;
}

}  // namespace

LockFile::~LockFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<void> LockFile::Acquire(const std::string& path) {
  std::error_code ignored;
  fs::create_directories(fs::path(path).parent_path(), ignored);
  const int descriptor = ::open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0640);
  if (descriptor < 0)
    return Error{ErrorCode::kUnavailable,
                 path + ": " + std::error_code(errno, std::generic_category()).message()};
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    ::close(descriptor);
    return Error{ErrorCode::kFailedPrecondition,
                 path + " is held by another server; give this one another acceptance.folder"};
  }
  descriptor_ = descriptor;
  return {};
}

AcceptanceStore::AcceptanceStore(std::vector<AcceptedLink> links, std::string folder, Clock& clock)
    : links_(std::move(links)),
      folder_(std::move(folder)),
      clock_(clock),
      entries_(links_.size()),
      summaries_(links_.size()) {
  for (size_t link = 0; link < links_.size(); ++link) {
    if (!folder_.empty()) Load(link);
    if (links_[link].recorded.empty()) continue;
    Entry& entry = entries_[link];
    auto recorded = Parse("the log's acceptance", links_[link].recorded, entry.finished_plan);
    if (recorded)
      entry.finished = *std::move(recorded);
    else
      SPDLOG_WARN("acceptance: {}", Printable(recorded.error().message));
    SetSummary(link);
  }
}

// Reloads after locking: another server may have written here before.
Result<void> AcceptanceStore::Own(size_t link) {
  if (auto good = CheckFolder(); !good) return good;
  Entry& entry = entries_[link];
  if (entry.lock.held()) return {};
  if (auto acquired = entry.lock.Acquire(PathOf(link, "lock")); !acquired) return acquired;
  Load(link);
  return {};
}

std::string AcceptanceStore::PathOf(size_t link, const std::string& file) const {
  return (fs::path(folder_) / links_[link].name / file).string();
}

void AcceptanceStore::Load(size_t link) {
  Entry& entry = entries_[link];
  const auto take = [](Result<std::optional<AcceptanceRecord>> loaded) {
    if (loaded) return *std::move(loaded);
    SPDLOG_WARN("acceptance: {}; it is left as it is and not used", Printable(loaded.error().message));
    return std::optional<AcceptanceRecord>();
  };
  auto current = LoadRecord(PathOf(link, "current.json"), entry.current_plan);
  entry.unreadable = current ? "" : current.error().message;
  entry.current = take(std::move(current));
  entry.finished = take(LoadRecord(PathOf(link, "accepted.json"), entry.finished_plan));
  SetSummary(link);
}

// None: there is no such file.
Result<std::optional<AcceptanceRecord>> AcceptanceStore::LoadRecord(const std::string& path,
                                                                    std::string& plan_text) {
  const auto text = ReadFile(path);
  if (!text && text.error().code == ErrorCode::kNotFound) return std::optional<AcceptanceRecord>();
  if (!text) return text.error();
  auto record = Parse(path, *text, plan_text);
  if (!record) return record.error();
  return std::optional(*std::move(record));
}

Result<AcceptanceRecord> AcceptanceStore::Parse(const std::string& path, const std::string& text,
                                                std::string& plan_text) {
  v1::Acceptance message;
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto parsed = google::protobuf::util::JsonStringToMessage(text, &message, options);
  const auto plan = parsed.ok() ? ParseAcceptancePlan(path, message.plan_text())
                                : Result<AcceptancePlan>(Error{ErrorCode::kInvalidArgument,
                                                               path + ": " + std::string(parsed.message())});
  if (!plan) return plan.error();
  AcceptanceRecord record = FromWire(message);
  record.limits = plan->limits;
  plan_text = message.plan_text();
  return record;
}

Result<void> AcceptanceStore::CheckFolder() const {
  if (!folder_.empty()) return {};
  return Error{ErrorCode::kFailedPrecondition,
               "this server has no folder for acceptances; configure acceptance: {folder: ...}"};
}

int64_t AcceptanceStore::CalibratedUtcNs(size_t link) const {
  return links_[link].calibrated_utc_ns ? links_[link].calibrated_utc_ns() : 0;
}

Result<v1::Acceptance> AcceptanceStore::Start(size_t link, const std::string& plan_name,
                                              const std::string& plan_text, bool restart) {
  // File names are not accepted: the caller would read files of this machine.
  const std::string text = plan_text.empty() ? std::string(ShippedPlanText(plan_name)) : plan_text;
  if (text.empty()) {
    return Error{ErrorCode::kInvalidArgument, "there is no shipped plan '" + plan_name +
                                                  "'; send the plan itself as plan_text, or use " +
                                                  fmt::format("{}", fmt::join(ShippedPlanNames(), ", "))};
  }
  const auto plan = ParseAcceptancePlan("plan_text", text);
  if (!plan) return plan.error();
  auto trials = MakeTrials(*plan, links_[link].model);
  if (!trials) return trials.error();
  const std::lock_guard lock(mutex_);
  if (auto owned = Own(link); !owned) return owned.error();
  Entry& entry = entries_[link];
  if (entry.is_measuring) return IsMeasuring(link);
  if (!entry.unreadable.empty() && !restart) {
    return Error{ErrorCode::kFailedPrecondition,
                 "an acceptance of link '" + links_[link].name + "' is under way, but cannot be read: " +
                     entry.unreadable + "; mend the file, or start anew with restart, which puts it aside"};
  }
  if (!entry.unreadable.empty()) {
    std::error_code error;
    fs::rename(PathOf(link, "current.json"), PathOf(link, "current.json.unreadable"), error);
    if (error)
      return Error{ErrorCode::kUnavailable, "cannot put the unreadable acceptance aside: " + error.message()};
    entry.unreadable.clear();
  }
  if (entry.current && !restart) {
    if (entry.current->model_hash != links_[link].model_hash) {
      return Error{ErrorCode::kFailedPrecondition,
                   "the model of link '" + links_[link].name +
                       "' was changed since its acceptance began: finish it, or start anew with restart"};
    }
    if (entry.current_plan == text) return Save(link);
    return Error{ErrorCode::kFailedPrecondition,
                 "an acceptance of link '" + links_[link].name + "' by plan '" + entry.current->plan +
                     "' is under way: resume it with that plan, finish it, or discard it"};
  }
  entry.current = AcceptanceRecord{.link = links_[link].name,
                                   .plan = plan->name,
                                   .model = links_[link].model.name,
                                   .model_hash = links_[link].model_hash,
                                   .calibrated_utc_ns = CalibratedUtcNs(link),
                                   .started_utc_ns = clock_.UtcNs(),
                                   .limits = plan->limits,
                                   .trials = std::move(*trials)};
  entry.current_plan = text;
  return Save(link);
}

// Requires mutex_. Returns the message only after it was written to the disk.
Result<v1::Acceptance> AcceptanceStore::Save(size_t link) {
  const Entry& entry = entries_[link];
  v1::Acceptance message = MessageOf(*entry.current, entry.current_plan);
  const auto json = JsonOf(message);
  if (!json) return json.error();
  if (auto written = ReplaceFile(PathOf(link, "current.json"), *json); !written) return written.error();
  server::Fill(AnalyzeAcceptance(*entry.current), *message.mutable_report());
  return message;
}

Error AcceptanceStore::IsMeasuring(size_t link) const {
  return {ErrorCode::kFailedPrecondition,
          "a trial of link '" + links_[link].name + "' is being measured; wait for its end, or cancel it"};
}

Result<const AcceptanceRecord*> AcceptanceStore::Current(size_t link) const {
  if (entries_[link].current) return &*entries_[link].current;
  return Error{ErrorCode::kFailedPrecondition,
               "no acceptance of link '" + links_[link].name + "' is under way; start one"};
}

Result<AcceptanceTrial> AcceptanceStore::Trial(size_t link, uint32_t trial) const {
  const std::lock_guard lock(mutex_);
  const auto record = Current(link);
  if (!record) return record.error();
  const auto found = std::ranges::find((*record)->trials, trial, &AcceptanceTrial::id);
  if (found == (*record)->trials.end()) {
    return Error{ErrorCode::kNotFound, fmt::format("there is no trial {}; the acceptance has trials 1 to {}",
                                                   trial, (*record)->trials.size())};
  }
  AcceptanceTrial planned = *found;
  const LinkModel& model = links_[link].model;
  // An acceptance that was started with another model may have markers that this model does not have.
  if (planned.path > 0 && planned.path <= model.markers.paths && planned.ring > 0 &&
      planned.ring <= model.markers.rings()) {
    const double angle = model.PathAngle(planned.path - 1);
    const double z_mm = model.markers.rings_z_mm[static_cast<size_t>(planned.ring - 1)];
    if (!planned.reference.place_mm) planned.reference.place_mm = model.PointAtDepth(angle, z_mm, 0);
    if (!planned.reference.direction) planned.reference.direction = -model.OutwardNormal(angle, z_mm);
  }
  return planned;
}

bool AcceptanceStore::Claim(size_t link) {
  const std::lock_guard lock(mutex_);
  return !std::exchange(entries_[link].is_measuring, true);
}

void AcceptanceStore::Release(size_t link) {
  const std::lock_guard lock(mutex_);
  entries_[link].is_measuring = false;
}

Result<v1::Acceptance> AcceptanceStore::Store(size_t link, uint32_t trial, v1::TrialPhase phase,
                                              const TrialReading& reading,
                                              const std::optional<TrialReference>& reference) {
  const std::lock_guard lock(mutex_);
  if (auto owned = Own(link); !owned) return owned.error();
  if (const auto record = Current(link); !record) return record.error();
  auto& trials = entries_[link].current->trials;
  const auto found = std::ranges::find(trials, trial, &AcceptanceTrial::id);
  if (found == trials.end())
    return Error{ErrorCode::kFailedPrecondition, "the acceptance was replaced while the trial was measured"};
  if (phase == v1::TRIAL_PHASE_UNLOADED) {
    found->unloaded = reading;
  } else if (phase == v1::TRIAL_PHASE_RELEASED) {
    found->released = reading;
  } else {
    found->loaded = reading;
    found->released.reset();
    if (reference) found->reference = *reference;
    found->state = TrialState::kMeasured;
  }
  return Save(link);
}

Result<v1::Acceptance> AcceptanceStore::Skip(size_t link, uint32_t trial, bool reopen) {
  if (const auto known = Trial(link, trial); !known) return known.error();
  const std::lock_guard lock(mutex_);
  if (auto owned = Own(link); !owned) return owned.error();
  if (const auto record = Current(link); !record) return record.error();
  auto& trials = entries_[link].current->trials;
  const auto found = std::ranges::find(trials, trial, &AcceptanceTrial::id);
  if (found == trials.end())
    return Error{ErrorCode::kFailedPrecondition, "the acceptance was replaced meanwhile"};
  found->state = reopen ? TrialState::kOpen : TrialState::kSkipped;
  if (reopen) {
    found->unloaded.reset();
    found->loaded.reset();
    found->released.reset();
  }
  return Save(link);
}

Result<v1::Acceptance> AcceptanceStore::Finish(size_t link, bool discard) {
  const std::lock_guard lock(mutex_);
  if (auto owned = Own(link); !owned) return owned.error();
  const auto current = Current(link);
  if (!current) return current.error();
  Entry& entry = entries_[link];
  if (entry.is_measuring) return IsMeasuring(link);
  if (discard) {
    v1::Acceptance message = MessageOf(*entry.current, entry.current_plan);
    if (auto removed = Remove(PathOf(link, "current.json")); !removed) return removed.error();
    entry.current.reset();
    return message;
  }
  AcceptanceRecord record = **current;
  record.finished_utc_ns = clock_.UtcNs();
  const AcceptanceReport report = AnalyzeAcceptance(record);
  if (report.measured == 0) {
    return Error{ErrorCode::kFailedPrecondition, "nothing was measured in the acceptance of link '" +
                                                     links_[link].name +
                                                     "': there is nothing to report; discard it, or measure"};
  }
  v1::Acceptance message = MessageOf(record, entry.current_plan);
  const auto json = JsonOf(message);
  if (!json) return json.error();
  const std::pair<std::string, std::string> files[] = {
      {UtcText(record.finished_utc_ns / kNsPerS) + ".json", *json},
      {"report.html", AcceptanceHtml(record, report)},
      {"report.csv", AcceptanceCsv(record, report)},
      {"accepted.json", *json}};
  for (const auto& [name, text] : files)
    if (auto written = ReplaceFile(PathOf(link, name), text); !written) return written.error();
  if (auto removed = Remove(PathOf(link, "current.json")); !removed) return removed.error();
  server::Fill(report, *message.mutable_report());
  entry.finished = std::move(record);
  entry.finished_plan = std::exchange(entry.current_plan, {});
  entry.current.reset();
  SetSummary(link);
  return message;
}

Result<v1::Acceptance> AcceptanceStore::Get(size_t link, bool finished, bool with_files) const {
  const std::lock_guard lock(mutex_);
  const Entry& entry = entries_[link];
  const bool is_current = entry.current && !finished;
  if (!is_current && !entry.finished) {
    return Error{ErrorCode::kFailedPrecondition, "link '" + links_[link].name + "' has no acceptance" +
                                                     (finished ? " that is finished" : "") +
                                                     "; make one with: taclink accept " + links_[link].name};
  }
  const AcceptanceRecord& record = is_current ? *entry.current : *entry.finished;
  v1::Acceptance message = MessageOf(record, is_current ? entry.current_plan : entry.finished_plan);
  const AcceptanceReport report = AnalyzeAcceptance(record);
  server::Fill(report, *message.mutable_report());
  if (with_files) {
    message.set_report_html(AcceptanceHtml(record, report));
    message.set_report_csv(AcceptanceCsv(record, report));
  }
  return message;
}

void AcceptanceStore::SetSummary(size_t link) {
  const auto& finished = entries_[link].finished;
  if (!finished) return;
  Summarized made{SummaryOf(*finished, AnalyzeAcceptance(*finished)), finished->model_hash,
                  finished->calibrated_utc_ns};
  const std::lock_guard lock(summary_mutex_);
  summaries_[link] = std::move(made);
}

std::optional<v1::AcceptanceSummary> AcceptanceStore::Summary(size_t link) const {
  std::optional<Summarized> made;
  {
    const std::lock_guard lock(summary_mutex_);
    made = summaries_[link];
  }
  if (!made) return std::nullopt;
  if (!links_[link].recorded.empty()) return made->summary;
  const int64_t calibrated_ns = CalibratedUtcNs(link);
  if (made->model_hash != links_[link].model_hash)
    made->summary.set_outdated("the link's model was changed since");
  else if (made->calibrated_utc_ns != 0 && calibrated_ns != 0 && made->calibrated_utc_ns != calibrated_ns)
    made->summary.set_outdated("the cameras were calibrated again since");
  return made->summary;
}

std::string AcceptanceStore::FinishedFile(size_t link) const {
  const std::lock_guard lock(mutex_);
  const Entry& entry = entries_[link];
  if (!entry.finished) return "";
  const auto json = JsonOf(MessageOf(*entry.finished, entry.finished_plan));
  return json ? *json : "";
}

}  // namespace taclink::server
