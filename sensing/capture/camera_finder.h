#pragma once

#include <string>
#include <vector>

#include "sensing/core/result.h"

namespace taclink {

/// A camera that this machine has now, as the kernel describes it.
struct FoundCamera {
  std::string node;           ///< "/dev/video0"; changes when it is plugged in again
  std::string name;           ///< the maker's
  std::string usb_path;       ///< "1-2.3": bus and ports, stays while it is plugged in there; empty: not USB
  std::string usb_interface;  ///< "1-2.3:1.0", tells two cameras of one USB device apart
  std::string serial;         ///< empty: has none
};

/// Where to look; tests have trees of their own.
struct CameraPlaces {
  std::string sys = "/sys";
  std::string dev = "/dev";
};

/// All nodes that give pictures, ordered by number. (Cameras have further nodes for metadata; these are left
/// out.)
std::vector<FoundCamera> ListCameras(const CameraPlaces& places = {});

/// The device node of a camera that is named in one of these ways:
///   /dev/video0, /dev/v4l/by-path/...   a node or a link to one: taken as it is, not looked for
///   usb:1-2.3 or usb:1-2.3:1.0          where it is plugged in, with the interface where one has several
///   serial:ABC                          its serial number
/// Errors: kUnavailable: none such now, with what there is; kInvalidArgument: no such way of naming, or the
/// name fits several.
Result<std::string> FindCamera(const std::string& name, const CameraPlaces& places = {});

/// Without looking whether it is there. Errors: kInvalidArgument.
Result<void> CheckCameraName(const std::string& name);

/// "/dev/video0 'HD Camera' usb:1-2 serial:A1"
std::string Describe(const FoundCamera& camera);

}  // namespace taclink
