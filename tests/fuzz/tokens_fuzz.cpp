// The file of tokens: what is accepted reads back to the same, and finds nobody whose token it does not hold.
#include <fmt/format.h>

#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "sensing/core/utc_time.h"
#include "server/security/tokens.h"

namespace {

using taclink::server::Role;
using taclink::server::Tokens;

std::string LineOf(const Tokens::Entry& entry) {
  std::string line = entry.caller.name + (entry.caller.role == Role::kOperator ? " operator " : " viewer ");
  for (const uint8_t byte : entry.hash) line += fmt::format("{:02x}", byte);
  if (entry.expires_utc_s) line += " expires=" + taclink::UtcText(*entry.expires_utc_s);
  return line + "\n";
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto tokens = Tokens::Parse("tokens", text);
  if (!tokens.ok()) {
    if (!tokens.error().message.starts_with("tokens:")) std::abort();
    return 0;
  }
  if (tokens->entries().empty() || tokens->Find(text) != nullptr) std::abort();
  std::string lines;
  for (const Tokens::Entry& entry : tokens->entries()) {
    if (entry.caller.name.empty()) std::abort();
    if (entry.caller.role != Role::kViewer && entry.caller.role != Role::kOperator) std::abort();
    lines += LineOf(entry);
  }
  const auto again = Tokens::Parse("again", lines);
  if (!again.ok() || again->entries().size() != tokens->entries().size()) std::abort();
  // The changes name everything that a line says.
  if (!TokenChanges(*tokens, *again).empty()) std::abort();
  return 0;
}
