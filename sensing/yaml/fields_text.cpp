#include <array>
#include <charconv>
#include <string>

#include "sensing/yaml/fields.h"

namespace taclink {
namespace {

// A name like "1" or "no" must stay a text.
std::string QuotedText(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

// The shortest text that reads back to the same number, with a point where there is an exponent: YAML 1.1
// takes 1e-05 for a text.
std::string NumberText(double value) {
  std::array<char, 32> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  std::string text(buffer.data(), end);
  const size_t exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) text.insert(exponent, ".0");
  return text;
}

template <typename Values, typename Show>
std::string List(const Values& values, const Show& show) {
  std::string out;
  for (const auto& value : values) out += (out.empty() ? "" : ", ") + show(value);
  return "[" + out + "]";
}

// Top-level sections and the items of their lists are blocks, one key a line; mappings below are written in
// braces on one line.
class FieldWriter final : public FieldVisitor {
 public:
  /// `indent`: of the lines, but of the first one in the place where it stands: "- " in a list.
  FieldWriter(std::string& out, std::string first_indent, size_t indent, bool is_block)
      : out_(out), next_indent_(std::move(first_indent)), indent_(indent), is_block_(is_block) {}

  bool Wants(const Key& /*key*/, bool is_given) override { return is_given; }

 private:
  void Line(const Key& key, const std::string& value) {
    if (is_block_) {
      out_ += next_indent_ + key.name + ": " + value + "\n";
      next_indent_ = std::string(indent_, ' ');
    } else {
      out_ += (is_first_ ? "" : ", ") + std::string(key.name) + ": " + value;
    }
    is_first_ = false;
  }
  static std::string InBraces(const Fields& fields) {
    std::string text;
    FieldWriter braces(text, "", 0, false);
    fields(braces);
    return "{" + text + "}";
  }

  void Bool(const Key& key, bool& value) override { Line(key, value ? "true" : "false"); }
  void Integer(const Key& key, int& value, Range /*range*/) override { Line(key, std::to_string(value)); }
  void Number(const Key& key, double& value, Range /*range*/) override { Line(key, NumberText(value)); }
  void Text(const Key& key, std::string& value, TextKind /*kind*/) override { Line(key, QuotedText(value)); }
  void OneOf(const Key& key, size_t& index, const Names& names) override {
    Line(key, std::string(names[index]));
  }
  void Numbers(const Key& key, std::span<double> values, Range /*range*/) override {
    Line(key, List(values, NumberText));
  }
  void Integers(const Key& key, std::vector<int>& values, size_t /*count*/, Range /*range*/) override {
    Line(key, List(values, [](int value) { return std::to_string(value); }));
  }
  void Texts(const Key& key, std::span<std::string> values, const char* /*items*/) override {
    Line(key, List(values, QuotedText));
  }
  void Section(const Key& key, const Fields& fields) override {
    if (indent_ > 0 || !is_block_) return Line(key, InBraces(fields));
    out_ += std::string(key.name) + ":\n";
    FieldWriter block(out_, "  ", 2, true);
    fields(block);
  }
  void Maps(const Key& key, size_t count, const std::function<void(size_t, FieldVisitor&)>& fields) override {
    if (count == 0) return;
    out_ += std::string(indent_, ' ') + key.name + ":\n";
    const std::string item(indent_ + 2, ' ');
    for (size_t i = 0; i < count; ++i) {
      if (indent_ > 2) {
        out_ += item + "- " + InBraces([&](FieldVisitor& visit) { fields(i, visit); }) + "\n";
        continue;
      }
      FieldWriter block(out_, item + "- ", indent_ + 4, true);
      fields(i, block);
    }
  }
  void Alternatives(const Key& key, size_t index, const Names& names,
                    const std::function<void(size_t, FieldVisitor&)>& fields) override {
    Line(key, std::string(names[index]));
    fields(index, *this);
  }

  std::string& out_;
  std::string next_indent_;
  const size_t indent_;
  const bool is_block_;
  bool is_first_ = true;
};

}  // namespace

std::string FieldsText(const FieldVisitor::Fields& fields) {
  std::string out;
  FieldWriter writer(out, "", 0, true);
  fields(writer);
  return out;
}

}  // namespace taclink
