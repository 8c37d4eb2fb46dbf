#include "server/acceptance/acceptance_store.h"

#include <fcntl.h>
#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>

#include "sensing/acceptance/report_html.h"
#include "sensing/core/printable.h"
#include "sensing/core/read_file.h"
#include "sensing/core/utc_time.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kNsPerS = 1'000'000'000;

// A reader sees the old file or the new one, also after a power failure in between.
Result<void> WriteFile(const std::string& path, const std::string& text) {
  const std::string fresh = path + ".new";
  const auto failed = [&](const std::string& what) {
    return Error{ErrorCode::kUnavailable, fresh + ": " + what + "; the acceptance was not saved"};
  };
  std::error_code error;
  fs::create_directories(fs::path(path).parent_path(), error);
  if (error) return failed(error.message());
  std::ofstream file(fresh, std::ios::binary);
  file << text;
  file.flush();
  if (!file) return failed("cannot be written");
  file.close();
  fs::rename(fresh, path, error);
  if (error) return failed(error.message());
  return {};
}

std::string JsonOf(const v1::Acceptance& message) {
  std::string json;
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  static_cast<void>(google::protobuf::util::MessageToJsonString(message, &json, options));
  return json;
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
    entry.finished = Parse("the log's acceptance", links_[link].recorded, entry.finished_plan);
    SetSummary(link);
  }
}

// What another server has done here before this one got the lock is read again.
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
  entry.current = LoadRecord(PathOf(link, "current.json"), entry.current_plan);
  entry.finished = LoadRecord(PathOf(link, "accepted.json"), entry.finished_plan);
  SetSummary(link);
}

std::optional<AcceptanceRecord> AcceptanceStore::LoadRecord(const std::string& path, std::string& plan_text) {
  const auto text = ReadFile(path);
  if (text) return Parse(path, *text, plan_text);
  if (text.error().code != ErrorCode::kNotFound) SPDLOG_WARN("acceptance: {}", text.error().message);
  return std::nullopt;
}

std::optional<AcceptanceRecord> AcceptanceStore::Parse(const std::string& path, const std::string& text,
                                                       std::string& plan_text) {
  v1::Acceptance message;
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto parsed = google::protobuf::util::JsonStringToMessage(text, &message, options);
  const auto plan = parsed.ok() ? ParseAcceptancePlan(path, message.plan_text())
                                : Result<AcceptancePlan>(Error{ErrorCode::kInvalidArgument,
                                                               path + ": " + std::string(parsed.message())});
  if (!plan) {
    SPDLOG_WARN("acceptance: {}; it is left as it is and not used", Printable(plan.error().message));
    return std::nullopt;
  }
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

std::string AcceptanceStore::CalibrationHash(size_t link) const {
  return links_[link].calibration_hash ? links_[link].calibration_hash() : "";
}

Result<v1::Acceptance> AcceptanceStore::Start(size_t link, const std::string& plan_name,
                                              const std::string& plan_text, bool restart) {
  // Names of files are not taken: the caller would read files of this machine.
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
  if (entry.current && !restart) {
    if (entry.current_plan == text) return Save(link);
    return Error{ErrorCode::kFailedPrecondition,
                 "an acceptance of link '" + links_[link].name + "' by plan '" + entry.current->plan +
                     "' is under way: resume it with that plan, finish it, or discard it"};
  }
  entry.current = AcceptanceRecord{.link = links_[link].name,
                                   .plan = plan->name,
                                   .model = links_[link].model.name,
                                   .model_hash = links_[link].model_hash,
                                   .calibration_hash = CalibrationHash(link),
                                   .started_utc_ns = clock_.UtcNs(),
                                   .limits = plan->limits,
                                   .trials = std::move(*trials)};
  entry.current_plan = text;
  return Save(link);
}

// Under the lock. The message is made in any case, but returned only if it is on the disk.
Result<v1::Acceptance> AcceptanceStore::Save(size_t link) {
  const Entry& entry = entries_[link];
  v1::Acceptance message = MessageOf(*entry.current, entry.current_plan);
  if (auto written = WriteFile(PathOf(link, "current.json"), JsonOf(message)); !written)
    return written.error();
  server::Fill(AnalyzeAcceptance(*entry.current), *message.mutable_report());
  return message;
}

Result<AcceptanceRecord*> AcceptanceStore::Current(size_t link) {
  if (entries_[link].current) return &*entries_[link].current;
  return Error{ErrorCode::kFailedPrecondition,
               "no acceptance of link '" + links_[link].name + "' is under way; start one"};
}

Result<AcceptanceTrial> AcceptanceStore::Trial(size_t link, uint32_t trial) const {
  const std::lock_guard lock(mutex_);
  const auto record = const_cast<AcceptanceStore*>(this)->Current(link);
  if (!record) return record.error();
  const auto found = std::ranges::find((*record)->trials, trial, &AcceptanceTrial::id);
  if (found == (*record)->trials.end()) {
    return Error{ErrorCode::kNotFound, fmt::format("there is no trial {}; the acceptance has trials 1 to {}",
                                                   trial, (*record)->trials.size())};
  }
  AcceptanceTrial planned = *found;
  const LinkModel& model = links_[link].model;
  if (planned.path > 0) {
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
  const auto record = Current(link);
  if (!record) return record.error();
  const auto found = std::ranges::find((*record)->trials, trial, &AcceptanceTrial::id);
  if (found == (*record)->trials.end())
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
  const auto record = Current(link);
  if (!record) return record.error();
  const auto found = std::ranges::find((*record)->trials, trial, &AcceptanceTrial::id);
  if (found == (*record)->trials.end())
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
  std::error_code ignored;
  if (discard) {
    v1::Acceptance message = MessageOf(*entry.current, entry.current_plan);
    fs::remove(PathOf(link, "current.json"), ignored);
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
  const std::string json = JsonOf(message);
  const std::pair<std::string, std::string> files[] = {
      {UtcText(record.finished_utc_ns / kNsPerS) + ".json", json},
      {"report.html", AcceptanceHtml(record, report)},
      {"report.csv", AcceptanceCsv(record, report)},
      {"accepted.json", json}};
  for (const auto& [name, text] : files)
    if (auto written = WriteFile(PathOf(link, name), text); !written) return written.error();
  fs::remove(PathOf(link, "current.json"), ignored);
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
                  finished->calibration_hash};
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
  if (made->model_hash != links_[link].model_hash)
    made->summary.set_outdated("the link's model was changed since");
  else if (made->calibration_hash != CalibrationHash(link))
    made->summary.set_outdated("the cameras were calibrated again since");
  return made->summary;
}

std::string AcceptanceStore::FinishedFile(size_t link) const {
  const std::lock_guard lock(mutex_);
  const Entry& entry = entries_[link];
  return entry.finished ? JsonOf(MessageOf(*entry.finished, entry.finished_plan)) : "";
}

}  // namespace taclink::server
