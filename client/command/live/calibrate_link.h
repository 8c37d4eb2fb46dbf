#pragma once

#include <string>

#include "sensing/core/result.h"

namespace taclink::command {

/// `taclink calibrate --link`: a server's link as it is now. Progress goes to standard error.
struct LinkCalibration {
  std::string server = "127.0.0.1:50051";
  std::string link;
  int pairs = 8;      ///< rest pairs to average over
  int repeats = 1;    ///< calibrations, one after the other
  bool save = false;  ///< also write the link's configured calibration file on the server
  bool force = false;
  std::string out;  ///< file to write here; empty: none
  bool json = false;
};
Result<void> CalibrateLink(const LinkCalibration& calibration);

}  // namespace taclink::command
