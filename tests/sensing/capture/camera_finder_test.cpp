#include "sensing/capture/camera_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/sensing/capture/pictures.h"

namespace taclink {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// A tree as the kernel makes it.
class CameraFinderTest : public ::testing::Test {
 protected:
  CameraFinderTest() { fs::create_directories(Root() / "class/video4linux"); }

  fs::path Root() const { return folder_.path(); }
  CameraPlaces Places() const { return {.sys = folder_.path(), .dev = "/dev"}; }
  static void Write(const fs::path& path, const std::string& text) {
    fs::create_directories(path.parent_path());
    std::ofstream(path) << text << "\n";
  }

  void AddNode(const std::string& node, const std::string& name, const fs::path& device, int index = 0) {
    const fs::path at = Root() / "devices" / device / "video4linux" / node;
    Write(at / "name", name);
    Write(at / "index", std::to_string(index));
    fs::create_directory_symlink(Root() / "devices" / device, at / "device");
    fs::create_directory_symlink(at, Root() / "class/video4linux" / node);
  }
  void AddUsb(const std::string& node, const std::string& usb, const std::string& serial,
              const std::string& interface = ":1.0") {
    const fs::path at = fs::path("pci/usb1") / usb;
    Write(Root() / "devices" / at / "busnum", "1");
    if (!serial.empty()) Write(Root() / "devices" / at / "serial", serial);
    AddNode(node, "Fish eye", at / (usb + interface));
  }
  std::string Find(const std::string& name) const {
    const auto found = FindCamera(name, Places());
    return found ? *found : found.error().message;
  }

  TemporaryFolder folder_;
};

TEST_F(CameraFinderTest, ListsPictureNodesInOrderOfTheirNumbers) {
  AddUsb("video10", "1-2.3", "B2");
  AddUsb("video2", "1-1", "A1");
  AddNode("video3", "Fish eye", "pci/usb1/1-1/1-1:1.0", 1);  // metadata
  AddNode("video0", "vivid", "platform/vivid.0");
  const auto cameras = ListCameras(Places());
  ASSERT_EQ(cameras.size(), 3u);
  EXPECT_EQ(cameras[0].node, "/dev/video0");
  EXPECT_EQ(cameras[0].usb_path, "");
  EXPECT_EQ(cameras[1].node, "/dev/video2");
  EXPECT_EQ(cameras[1].usb_path, "1-1");
  EXPECT_EQ(cameras[2].usb_interface, "1-2.3:1.0");
  EXPECT_EQ(Describe(cameras[2]), "/dev/video10 'Fish eye' usb:1-2.3 serial:B2");
}

TEST_F(CameraFinderTest, FindsByUsbPathAndSerial) {
  AddUsb("video4", "1-2.3", "B2");
  AddUsb("video0", "1-2.31", "B21");
  EXPECT_EQ(Find("usb:1-2.3"), "/dev/video4");
  EXPECT_EQ(Find("usb:1-2.3:1.0"), "/dev/video4");
  EXPECT_EQ(Find("serial:B21"), "/dev/video0");
  EXPECT_EQ(Find("/dev/v4l/by-path/whatever"), "/dev/v4l/by-path/whatever");
}

TEST_F(CameraFinderTest, WhatIsMissingIsSaidWithWhatThereIs) {
  EXPECT_THAT(Find("usb:9-9"), AllOf(HasSubstr("usb:9-9"), HasSubstr("There is none")));
  AddUsb("video0", "1-1", "A1");
  EXPECT_THAT(Find("serial:A"), AllOf(HasSubstr("no such camera"), HasSubstr("usb:1-1 serial:A1")));
  EXPECT_EQ(FindCamera("serial:A", Places()).error().code, ErrorCode::kUnavailable);
}

TEST_F(CameraFinderTest, TwoThatFitAreNotGuessed) {
  AddUsb("video0", "1-1", "SN0001");
  AddUsb("video2", "1-2", "SN0001");
  AddUsb("video4", "1-3", "", ":1.0");
  AddUsb("video6", "1-3", "", ":1.2");
  EXPECT_THAT(Find("serial:SN0001"), AllOf(HasSubstr("fits 2 cameras"), HasSubstr("usb:1-2")));
  EXPECT_EQ(FindCamera("serial:SN0001", Places()).error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(Find("usb:1-3"), HasSubstr("with the interface"));
  EXPECT_EQ(Find("usb:1-3:1.2"), "/dev/video6");
}

TEST_F(CameraFinderTest, OtherNamesAreRefused) {
  for (const char* bad : {"", "video0", "usb:", "serial:", "USB:1-1"})
    EXPECT_THAT(Find(bad), HasSubstr("names no camera")) << bad;
}

TEST(CameraFinder, AMachineWithoutCamerasHasNone) {
  EXPECT_TRUE(ListCameras({.sys = "/no-such-folder"}).empty());
}

}  // namespace
}  // namespace taclink
