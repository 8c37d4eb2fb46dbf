#include "client/command/cli/arguments.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace taclink::command {

Check::Check(const std::function<std::string(const std::string& text)>& problem)
    : Check(CLI::Validator([problem](std::string& text) { return problem(text); }, "")) {}
Check::Check(CLI::Validator validator)
    : validator_(std::make_shared<const CLI::Validator>(std::move(validator))) {}

std::string Check::Problem(const std::string& text) const {
  std::string copy = text;
  return (*validator_)(copy);
}

Check Within(double min, double max) {
  const auto problem = [=](const std::string& text) -> std::string {
    double value = 0;
    if (CLI::detail::lexical_cast(text, value) && value >= min && value <= max) return {};
    return "'" + text + "' is not a number from " + fmt::format("{} to {}", min, max);
  };
  return Check(CLI::Validator([problem](std::string& text) { return problem(text); }, "NUMBER"));
}
Check Between(int min, int max) {
  return Check(CLI::Range(min, max));
}
Check Positive() {
  // CLI11's PositiveNumber prints both ends of the range of double.
  const auto problem = [](const std::string& text) -> std::string {
    double value = 0;
    if (CLI::detail::lexical_cast(text, value) && value > 0 && std::isfinite(value)) return {};
    return "'" + text + "' is not a positive number";
  };
  return Check(CLI::Validator([problem](std::string& text) { return problem(text); }, "POSITIVE"));
}
Check OneOf(std::initializer_list<const char*> names) {
  return OneOf(std::vector<std::string>(names.begin(), names.end()));
}

Check OneOf(std::vector<std::string> names, const std::string& other) {
  if (!other.empty()) names.insert(names.begin(), other);
  return Check(CLI::IsMember(std::move(names)));
}

const Option& Option::Must(const Check& check) const {
  option_->check(*check.validator_);
  return *this;
}
const Option& Option::Required() const {
  option_->required();
  return *this;
}
const Option& Option::ShowDefault() const {
  option_->capture_default_str();
  return *this;
}
const Option& Option::Needs(const Option& other) const {
  option_->needs(other.option_);
  return *this;
}
const Option& Option::Needs(const std::string& other) const {
  option_->needs(other);
  return *this;
}
const Option& Option::Excludes(const Option& other) const {
  option_->excludes(other.option_);
  return *this;
}
const Option& Option::Delimiter(char delimiter) const {
  option_->delimiter(delimiter);
  return *this;
}
const Option& Option::Expected(int values) const {
  option_->expected(values);
  return *this;
}
const Option& Option::Expected(int least, int most) const {
  option_->expected(least, most);
  return *this;
}
const Option& Option::OneValueEach() const {
  option_->allow_extra_args(false);
  return *this;
}
const Option& Option::FromEnvironment(const std::string& variable) const {
  option_->envname(variable);
  return *this;
}
bool Option::IsGiven() const {
  return option_->count() > 0;
}

Arguments Arguments::AddCommand(const std::string& name, const std::string& help) const {
  return Arguments(*app_->add_subcommand(name, help));
}
void Arguments::Group(const std::string& heading, std::initializer_list<const char*> commands) const {
  for (const char* command : commands) app_->get_subcommand(command)->group(heading);
}
void Arguments::RequireCommand() const {
  app_->require_subcommand(1);
}
bool Arguments::HasCommand() const {
  return !app_->get_subcommands().empty();
}
Option Arguments::AddFlag(const std::string& name, bool& value, const std::string& help) const {
  return Option(app_->add_flag(name, value, help));
}
void Arguments::OnChosen(std::function<void()> run) const {
  app_->callback(std::move(run));
}

template <typename Value>
Option Arguments::AddOption(const std::string& name, Value& value, const std::string& help) const {
  return Option(app_->add_option(name, value, help));
}
#define TACLINK_OPTION(...) \
  template Option Arguments::AddOption(const std::string&, __VA_ARGS__&, const std::string&) const
TACLINK_OPTION(std::string);
TACLINK_OPTION(std::optional<std::string>);
TACLINK_OPTION(std::vector<std::string>);
TACLINK_OPTION(int);
TACLINK_OPTION(unsigned);
TACLINK_OPTION(uint64_t);
TACLINK_OPTION(std::optional<uint64_t>);
TACLINK_OPTION(std::optional<int>);
TACLINK_OPTION(std::vector<int>);
TACLINK_OPTION(double);
TACLINK_OPTION(std::optional<double>);
TACLINK_OPTION(std::vector<double>);
#undef TACLINK_OPTION

void RefuseOption(const std::string& name, const std::string& why) {
  throw CLI::ValidationError(name, why);
}
void RefuseMissing(const std::string& what) {
  throw CLI::RequiredError(what);
}

}  // namespace taclink::command
