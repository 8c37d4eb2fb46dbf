#include "sensing/pipeline/options_text.h"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>
#include <string_view>

namespace taclink {
namespace {

using TextMap = std::map<std::string, std::string>;

constexpr const char* kAuto = "auto";
constexpr double kLargest = std::numeric_limits<double>::max();

constexpr const char* kForceModel = "force.model";
constexpr const char* kForceRefinement = "force.refinement";
constexpr const char* kMayRepeat = "pictures_may_repeat";  // not there: false
constexpr const char* kPressure = "pressure_mpa";
constexpr const char* kPressureSigma = "pressure_sigma_mpa";  // not there: as is usual for the source
constexpr const char* kDriftFollow = "drift.follow";
struct DriftNumber {
  const char* key;
  double DriftOptions::* value;
};
constexpr std::array<DriftNumber, 6> kDriftNumbers = {
    {{"drift.time_constant_s", &DriftOptions::time_constant_s},
     {"drift.rate_limit_mm_s", &DriftOptions::rate_limit_mm_s},
     {"drift.limit_mm", &DriftOptions::limit_mm},
     {"drift.stop_n", &DriftOptions::stop_n},
     {"drift.go_n", &DriftOptions::go_n},
     {"drift.quiet_s", &DriftOptions::quiet_s}}};

Error Bad(const std::string& what) {
  return {ErrorCode::kInvalidArgument, what};
}

// The shortest text that reads back to the same number.
std::string NumberText(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

/// Takes values out of a map; keeps the first thing that is wrong with it.
class Reader {
 public:
  explicit Reader(const TextMap& text) : text_(text) {}

  std::string Text(const std::string& key) {
    used_.insert(key);
    const auto at = text_.find(key);
    if (at != text_.end()) return at->second;
    Fail("'" + key + "' is missing");
    return {};
  }
  double Number(const std::string& key, double min, double max) {
    const std::string text = Text(key);
    double value = 0;
    const char* const end = text.data() + text.size();
    const auto read = std::from_chars(text.data(), end, value);
    const bool good = read.ec == std::errc() && read.ptr == end && value >= min && value <= max;
    if (!good)
      Fail("'" + key + "' is '" + text + "', not a number from " + NumberText(min) + " to " +
           NumberText(max));
    return good ? value : min;
  }
  bool Bool(const std::string& key) {
    const std::string text = Text(key);
    if (text != "true" && text != "false") Fail("'" + key + "' is '" + text + "', not true or false");
    return text == "true";
  }
  void Fail(const std::string& what) {
    if (trouble_.empty()) trouble_ = what;
  }
  std::string Finish() {
    for (const auto& [key, value] : text_) {
      if (!used_.contains(key)) Fail("'" + key + "' is not known to this version");
    }
    return trouble_;
  }

 private:
  const TextMap& text_;
  std::set<std::string> used_;
  std::string trouble_;
};

DriftOptions ReadDrift(Reader& reader) {
  DriftOptions drift;
  for (const DriftNumber& number : kDriftNumbers)
    drift.*number.value = reader.Number(number.key, std::numeric_limits<double>::min(), kLargest);
  if (drift.go_n >= drift.stop_n) reader.Fail("'drift.go_n' must be below 'drift.stop_n'");
  return drift;
}

}  // namespace

std::string ForceModelText(const std::optional<ForceModel>& model) {
  return model ? Name(*model) : kAuto;
}

Result<std::optional<ForceModel>> ParseForceModel(const std::string& text) {
  if (text == kAuto) return std::optional<ForceModel>();
  std::string names = kAuto;
  for (const ForceModel model : kForceModels) {
    if (text == Name(model)) return std::optional(model);
    names += std::string(", ") + Name(model);
  }
  return Bad("'" + text + "' is no force model; there are " + names);
}

TextMap OptionsText(const PipelineOptions& options) {
  TextMap text = {{kForceModel, ForceModelText(options.force.model)},
                  {kForceRefinement, std::to_string(options.force.refinement)},
                  {kDriftFollow, options.drift ? "true" : "false"}};
  if (options.pictures_may_repeat) text[kMayRepeat] = "true";
  if (options.pressure_mpa) text[kPressure] = NumberText(*options.pressure_mpa);
  if (options.pressure_sigma_mpa) text[kPressureSigma] = NumberText(*options.pressure_sigma_mpa);
  if (!options.drift) return text;
  for (const DriftNumber& number : kDriftNumbers)
    text[number.key] = NumberText((*options.drift).*number.value);
  return text;
}

Result<PipelineOptions> ParseOptionsText(const TextMap& text) {
  Reader reader(text);
  PipelineOptions options;
  const auto model = ParseForceModel(reader.Text(kForceModel));
  if (model) {
    options.force.model = *model;
  } else {
    reader.Fail("'" + std::string(kForceModel) + "': " + model.error().message);
  }
  const double refinement = reader.Number(kForceRefinement, 0, 3);
  options.force.refinement = static_cast<int>(refinement);
  if (options.force.refinement != refinement)
    reader.Fail(std::string("'") + kForceRefinement + "' is not a whole number");
  if (text.contains(kMayRepeat)) options.pictures_may_repeat = reader.Bool(kMayRepeat);
  // 0 tells nothing here, as in logs that always have it: frames say who tells their pressure.
  if (text.contains(kPressure)) {
    const double mpa = reader.Number(kPressure, -1, 1);
    if (mpa != 0) options.pressure_mpa = mpa;
  }
  if (text.contains(kPressureSigma)) options.pressure_sigma_mpa = reader.Number(kPressureSigma, 1e-9, 1);
  if (reader.Bool(kDriftFollow)) options.drift = ReadDrift(reader);
  if (const std::string trouble = reader.Finish(); !trouble.empty()) return Bad(trouble);
  return options;
}

}  // namespace taclink
