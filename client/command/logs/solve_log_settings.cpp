#include "client/command/logs/solve_log_settings.h"

#include <algorithm>
#include <set>

#include "sensing/camera/calibration_file.h"
#include "sensing/core/read_file.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/options_text.h"
#include "wire/log/topics.h"

namespace taclink::command {
namespace {

using Texts = std::map<std::string, std::string>;  // by name

std::string Joined(const std::set<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

std::set<std::string> LinksOf(const mcap::Reader& log) {
  std::set<std::string> links;
  for (const auto& [id, channel] : log.channels()) {
    const auto topic = wire::log::ParseTopic(channel.topic);
    if (topic && topic->kind == wire::log::TopicKind::kFrame) links.insert(topic->link);
  }
  return links;
}

Result<std::set<std::string>> WantedLinks(const mcap::Reader& log, const std::vector<std::string>& names) {
  const std::set<std::string> all = LinksOf(log);
  if (all.empty()) return Error{ErrorCode::kInvalidArgument, "the log holds no frames of any link"};
  for (const std::string& name : names) {
    if (!all.contains(name))
      return Error{ErrorCode::kNotFound, "the log has no link '" + name + "'; it has " + Joined(all)};
  }
  return names.empty() ? all : std::set<std::string>(names.begin(), names.end());
}

/// LINK=FILE for one link, FILE for all of them. The last one that names a link holds.
Result<Texts> ByLink(const std::vector<std::string>& arguments, const std::set<std::string>& links) {
  Texts files;
  for (const bool named : {false, true}) {
    for (const std::string& argument : arguments) {
      const size_t mark = argument.find('=');
      if ((mark != std::string::npos) != named) continue;
      if (!named) {
        for (const std::string& link : links) files[link] = argument;
      } else if (const std::string link = argument.substr(0, mark); links.contains(link)) {
        files[link] = argument.substr(mark + 1);
      } else {
        return Error{ErrorCode::kNotFound,
                     "'" + argument + "': no link '" + link + "' is solved; there are " + Joined(links)};
      }
    }
  }
  return files;
}

Result<std::string> FileText(const std::string& path) {
  return ReadFile(path);
}

/// The log's texts that settings are made of.
struct Records {
  Texts attachments;
  std::map<std::string, mcap::TextMap> metadata;
};

Result<Records> ReadRecords(const mcap::Reader& log, const std::set<std::string>& links) {
  std::set<std::string> wanted;
  for (const std::string& link : links) {
    wanted.insert(wire::log::ModelAttachment(link));
    wanted.insert(wire::log::CalibrationAttachment(link));
    wanted.insert(wire::log::LinkMetadataName(link));
  }
  Records records;
  mcap::Buffer buffer;
  for (const mcap::AttachmentIndex& index : log.attachments()) {
    if (!wanted.contains(index.name)) continue;
    const auto attachment = log.ReadAttachment(index, buffer);
    if (!attachment) return attachment.error();
    records.attachments[index.name].assign(reinterpret_cast<const char*>(attachment->data.data()),
                                           attachment->data.size());
  }
  for (const mcap::MetadataIndex& index : log.metadata()) {
    if (!wanted.contains(index.name)) continue;
    auto record = log.ReadMetadata(index);
    if (!record) return record.error();
    records.metadata[index.name] = std::move(record->metadata);
  }
  return records;
}

const std::string* Find(const Texts& texts, const std::string& name) {
  const auto at = texts.find(name);
  return at == texts.end() ? nullptr : &at->second;
}

Result<void> FindModel(const std::string* given, const Records& records, LinkSettings& out) {
  const std::string attachment = wire::log::ModelAttachment(out.name);
  if (given != nullptr) {
    auto text = LinkModelText(*given);
    if (!text) return text.error();
    out.new_model = std::move(*text);
    out.changes["model"] = *given;
  }
  const std::string* const recorded = Find(records.attachments, attachment);
  if (given == nullptr && recorded == nullptr)
    return Error{ErrorCode::kNotFound, "the log has no model of link '" + out.name + "' (" + attachment +
                                           "); give --model " + out.name + "=FILE"};
  auto model = given != nullptr ? ParseLinkModel(*given, *out.new_model)
                                : ParseLinkModel("the log's " + attachment, *recorded);
  if (!model) return model.error();
  out.model = std::move(*model);
  return {};
}

Result<void> FindCalibration(const std::string* given, const Records& records, LinkSettings& out) {
  const std::string attachment = wire::log::CalibrationAttachment(out.name);
  if (given != nullptr) {
    auto text = FileText(*given);
    if (!text) return text.error();
    out.new_calibration = std::move(*text);
    out.changes["calibration"] = *given;
  }
  const std::string* const recorded = Find(records.attachments, attachment);
  if (given == nullptr && recorded == nullptr) return {};  // the first pictures calibrate
  const auto saved = given != nullptr ? ParseCalibration(*given, *out.new_calibration, out.model)
                                      : ParseCalibration("the log's " + attachment, *recorded, out.model);
  if (!saved && given == nullptr && out.new_model)
    return Error{saved.error().code, saved.error().message + "; give --calibration for the new model"};
  if (!saved) return saved.error();
  out.options.rig = saved->rig;
  out.options.calibrated_utc_s = saved->identity.made_utc_s;
  return {};
}

Result<void> FindOptions(const SolveLogOptions& options, const Records& records, LinkSettings& out) {
  const std::string record = wire::log::LinkMetadataName(out.name);
  if (const auto at = records.metadata.find(record); at != records.metadata.end()) {
    auto read = ParseOptionsText(at->second);
    if (!read) return Error{read.error().code, "metadata record " + record + ": " + read.error().message};
    out.options = std::move(*read);
  } else {
    out.options.force.model.reset();
    out.options.drift.emplace();
    out.warnings.push_back("the log does not say how the link was solved (metadata record " + record +
                           "); the server's defaults are taken");
  }
  const mcap::TextMap before = OptionsText(out.options);
  if (options.force_model) {
    const auto model = ParseForceModel(*options.force_model);
    if (!model) return model.error();
    out.options.force.model = *model;
  }
  if (options.force_refinement) out.options.force.refinement = *options.force_refinement;
  for (const auto& [key, value] : OptionsText(out.options)) {
    if (value != before.at(key)) out.changes[key] = before.at(key) + " -> " + value;
  }
  return {};
}

}  // namespace

Result<std::vector<LinkSettings>> FindSettings(const mcap::Reader& log, const SolveLogOptions& options) {
  const auto links = WantedLinks(log, options.links);
  if (!links) return links.error();
  const auto models = ByLink(options.models, *links), calibrations = ByLink(options.calibrations, *links);
  if (!models) return models.error();
  if (!calibrations) return calibrations.error();
  const auto records = ReadRecords(log, *links);
  if (!records) return records.error();
  std::vector<LinkSettings> out;
  for (const std::string& name : *links) {
    LinkSettings& link = out.emplace_back();
    link.name = name;
    if (auto found = FindOptions(options, *records, link); !found) return found.error();
    if (auto found = FindModel(Find(*models, name), *records, link); !found) return found.error();
    if (auto found = FindCalibration(Find(*calibrations, name), *records, link); !found) return found.error();
  }
  return out;
}

}  // namespace taclink::command
