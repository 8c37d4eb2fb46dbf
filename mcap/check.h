#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mcap/byte_source.h"
#include "mcap/load.h"

namespace taclink::mcap {

enum class Severity : uint8_t {
  kError,    ///< damaged, or against what the specification demands
  kWarning,  ///< against what it recommends, or something that readers profit from is missing
};

struct Finding {
  Severity severity = Severity::kError;
  uint64_t offset = 0;  ///< of the record that is meant
  std::string what;
};

struct CheckReport {
  std::vector<Finding> findings;  ///< the first thousand, errors and warnings as they come
  uint64_t errors = 0;            ///< all
  uint64_t warnings = 0;          ///< all
  bool ok() const { return errors == 0; }
};

/// Checks a log completely against the specification: magic, structure, every CRC, that indexes, statistics
/// and summary agree with the content, references, times. Ends at the first place where the structure of
/// records breaks, since nothing behind it can be judged (Scan goes on there). Errors: the source's.
Result<CheckReport> Check(const ByteSource& source, const Limits& limits = {});

}  // namespace taclink::mcap
