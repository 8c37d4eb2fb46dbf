#pragma once

#include <string>

#include "client/cpp/taclink/client.h"

namespace taclink::command {

/// `taclink calibrate --link`: a server's link as it is now. Progress goes to standard error.
struct LinkCalibration {
  std::string server = "127.0.0.1:50051";
  client::CalibrateOptions options;
  std::string out;  ///< file to write here; empty: none
  bool json = false;
};
Result<void> CalibrateLink(const LinkCalibration& calibration);

}  // namespace taclink::command
