#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

// Wraps CLI11, whose headers take seconds to compile wherever they are included.
namespace taclink::command {

/// What a value has to be.
class Check {
 public:
  /// `problem`: empty, or what is wrong with the text.
  explicit Check(const std::function<std::string(const std::string& text)>& problem);
  explicit Check(CLI::Validator validator);

  std::string Problem(const std::string& text) const;

 private:
  friend class Option;
  std::shared_ptr<const CLI::Validator> validator_;
};

/// A number from `min` to `max`, both included. Not "nan", which CLI11's own check lets through.
Check Within(double min, double max);
/// The same for whole numbers.
Check Between(int min, int max);
Check Positive();
Check OneOf(std::initializer_list<const char*> names);
/// One of `names`, or `other`.
Check OneOf(std::vector<std::string> names, const std::string& other = "");

/// A handle of one option of a command.
class Option {
 public:
  const Option& Must(const Check& check) const;  ///< of every value
  const Option& Required() const;
  const Option& ShowDefault() const;  ///< its value now, in the help
  const Option& Needs(const Option& other) const;
  const Option& Needs(const std::string& other) const;
  const Option& Excludes(const Option& other) const;
  const Option& Delimiter(char delimiter) const;  ///< between values
  const Option& Expected(int values) const;
  const Option& Expected(int least, int most) const;
  const Option& OneValueEach() const;  ///< of a list: what follows is not taken as well
  const Option& FromEnvironment(const std::string& variable) const;
  bool IsGiven() const;

 private:
  friend class Arguments;
  explicit Option(CLI::Option* option) : option_(option) {}
  CLI::Option* option_;
};

/// A handle of a command that options and subcommands are added to.
class Arguments {
 public:
  explicit Arguments(CLI::App& app) : app_(&app) {}

  Arguments AddCommand(const std::string& name, const std::string& help) const;
  /// Lists these commands, which have been added, together under a heading of the help.
  void Group(const std::string& heading, std::initializer_list<const char*> commands) const;
  /// One of them has to be given.
  void RequireCommand() const;
  bool HasCommand() const;  ///< one was given
  /// Of text, a number, an optional or a list of them (arguments.cpp names the types). `value` has to outlive
  /// parsing.
  template <typename Value>
  Option AddOption(const std::string& name, Value& value, const std::string& help) const;
  Option AddFlag(const std::string& name, bool& value, const std::string& help) const;
  /// Called when the command was chosen and all its options are read.
  void OnChosen(std::function<void()> run) const;

 private:
  CLI::App* app_;
};

/// For OnChosen: ends the program with a usage error.
[[noreturn]] void RefuseOption(const std::string& name, const std::string& why);
[[noreturn]] void RefuseMissing(const std::string& what);

}  // namespace taclink::command
