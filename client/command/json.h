#pragma once

#include <array>
#include <concepts>
#include <string>
#include <string_view>

namespace taclink::command {

/// Writes one JSON value on one line. Commas are set by itself; keys and values are given in order.
class JsonWriter {
 public:
  JsonWriter& Begin(char bracket);  ///< '{' or '['
  JsonWriter& End(char bracket);    ///< '}' or ']'
  JsonWriter& Key(std::string_view key);

  JsonWriter& Value(std::string_view text);
  JsonWriter& Value(const char* text) { return Value(std::string_view(text)); }
  JsonWriter& Value(double number);  ///< null if it is not finite
  JsonWriter& Value(std::integral auto number) { return Raw(std::to_string(number)); }
  JsonWriter& Null() { return Raw("null"); }
  template <size_t N>
  JsonWriter& Value(const std::array<double, N>& numbers, double scale = 1) {
    Begin('[');
    for (const double number : numbers) Value(number * scale);
    return End(']');
  }
  template <typename... T>
  JsonWriter& Field(std::string_view key, const T&... value) {
    return Key(key).Value(value...);
  }

  const std::string& text() const { return text_; }

 private:
  JsonWriter& Raw(std::string_view text);
  void Separate();

  std::string text_;
  bool first_ = true;  // in the present bracket, or right after a key
};

}  // namespace taclink::command
