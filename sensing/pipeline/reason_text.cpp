#include "sensing/pipeline/reason_text.h"

#include <cstdarg>
#include <cstdio>

namespace taclink {

std::string ReasonText(const char* format, ...) {
  char text[400];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

}  // namespace taclink
