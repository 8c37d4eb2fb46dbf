#include "sensing/capture/v4l2_offers.h"

#include <linux/videodev2.h>
#include <sys/ioctl.h>

#include <array>
#include <cstdio>

namespace taclink {
namespace {

constexpr uint32_t kMaxListed = 12;

std::string Join(const std::string& list, const std::string& item, const char* separator) {
  return list.empty() ? item : list + separator + item;
}

bool IsReadable(uint32_t four_cc) {
  return four_cc == V4L2_PIX_FMT_YUYV || four_cc == V4L2_PIX_FMT_MJPEG || four_cc == V4L2_PIX_FMT_GREY;
}

std::string FourCcText(uint32_t four_cc) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const char letter = static_cast<char>((four_cc >> shift) & 0x7f);
    if (letter > ' ') text += letter;
  }
  return text;
}

std::string OfferedSizes(int fd, uint32_t four_cc) {
  std::string list;
  v4l2_frmsizeenum size{};
  size.pixel_format = four_cc;
  for (; size.index < kMaxListed && ioctl(fd, VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index) {
    if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      list =
          Join(list, std::to_string(size.discrete.width) + "x" + std::to_string(size.discrete.height), " ");
    } else {
      const v4l2_frmsize_stepwise& range = size.stepwise;
      return std::to_string(range.min_width) + "x" + std::to_string(range.min_height) + " to " +
             std::to_string(range.max_width) + "x" + std::to_string(range.max_height);
    }
  }
  return list;
}

}  // namespace

std::string OfferedFormats(int fd) {
  std::string readable, others;
  uint32_t listed = 0;
  v4l2_fmtdesc format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; ioctl(fd, VIDIOC_ENUM_FMT, &format) == 0; ++format.index) {
    const std::string name = FourCcText(format.pixelformat);
    if (IsReadable(format.pixelformat)) {
      readable = Join(readable, name + " " + OfferedSizes(fd, format.pixelformat), ", ");
    } else if (++listed <= kMaxListed) {
      others = Join(others, name, " ");
    }
  }
  if (listed > kMaxListed) others += " and more";
  if (others.empty()) return readable.empty() ? "nothing" : readable;
  return (readable.empty() ? "nothing that can be read here" : readable) +
         " (and formats that can't be read here: " + others + ")";
}

std::vector<CameraOffer> ListOffers(int fd) {
  std::vector<CameraOffer> offers;
  v4l2_fmtdesc format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; ioctl(fd, VIDIOC_ENUM_FMT, &format) == 0; ++format.index) {
    CameraOffer offer{.format = FourCcText(format.pixelformat),
                      .readable = IsReadable(format.pixelformat),
                      .size = {},
                      .rates = {}};
    v4l2_frmsizeenum size{};
    size.pixel_format = format.pixelformat;
    for (; ioctl(fd, VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index) {
      if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
        offer.size = OfferedSizes(fd, format.pixelformat);
        offers.push_back(offer);
        break;
      }
      const auto width = static_cast<int>(size.discrete.width);
      const auto height = static_cast<int>(size.discrete.height);
      offer.size = std::to_string(width) + "x" + std::to_string(height);
      offer.rates = OfferedRates(fd, format.pixelformat, width, height);
      offers.push_back(offer);
    }
  }
  return offers;
}

std::string OfferedRates(int fd, uint32_t four_cc, int width_px, int height_px) {
  std::string list;
  v4l2_frmivalenum interval{};
  interval.pixel_format = four_cc;
  interval.width = static_cast<uint32_t>(width_px);
  interval.height = static_cast<uint32_t>(height_px);
  const auto rate = [](const v4l2_fract& seconds) {
    return RateText(seconds.numerator > 0 ? double{1} * seconds.denominator / seconds.numerator : 0);
  };
  for (; ioctl(fd, VIDIOC_ENUM_FRAMEINTERVALS, &interval) == 0; ++interval.index) {
    if (interval.type != V4L2_FRMIVAL_TYPE_DISCRETE) {
      return rate(interval.stepwise.max) + " to " + rate(interval.stepwise.min);
    }
    list = Join(list, rate(interval.discrete), ", ");
  }
  return list.empty() ? "only its own rate" : list;
}

std::string RateText(double rate_hz) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", rate_hz);
  return text.data();
}

}  // namespace taclink
