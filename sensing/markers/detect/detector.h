#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/markers.h"
#include "sensing/markers/detect/blob_box.h"
#include "sensing/markers/detect/detector_peaks.h"

namespace taclink {

struct DetectorOptions {
  /// A marker is at least this much brighter than what surrounds it, gray levels; raised to 3.5 times the
  /// picture's noise, or 0.4 times its median level, where that is more.
  double min_contrast = 5;
  double min_area_px2 = 5;
  double max_area_fraction = 0.02;  ///< of the picture
  /// Longest over shortest axis of a whole blob. A dome near the edge of a fisheye picture has about 2.
  double max_elongation = 3.2;
  /// Area over that of the ellipse with the same second moments: 1 for every ellipse, below it for arcs,
  /// rings and merged blobs.
  double min_fill = 0.84;  ///< small blobs are let off with less
  double max_fill = 1.2;
  /// Part of the outline along which the picture is darker than half the blob's contrast.
  double min_dark_outline = 0.65;
  /// Contrast against the mean of the blobs within about 70 px; less is dust.
  double min_relative_contrast = 0.35;
  /// The part of a centre's error that is not pixel noise: sampling, and uneven shade, which grows with size.
  double sigma_floor_px = 0.034;
  double small_sigma_floor_px = 0.055;  ///< of blobs below some 60 px^2, which are mostly edge
  double sigma_per_size = 0.002;
};

/// Finds bright blobs on a darker surround, in any picture: knows nothing of links, and nothing of the
/// picture before. Two tests pick the pixels: brighter than the local background (a morphological opening
/// wider than any marker), and not darker than the mean of the 7 x 7 around. Connected pixels are a blob
/// [rosenfeld1966]. A compact blob with one summit is measured by its soft coverage; others come apart by
/// their summits (BellFinder), or at a higher level. The centre is that of the outline: shade inside is taken
/// out. A blob that the picture's edge cuts stands for a whole one, with a covariance that is long across the
/// edge. Allocates only when a picture is larger or fuller than those before. One thread.
class MarkerDetector {
 public:
  explicit MarkerDetector(DetectorOptions options = {});

  /// `gray`: CV_8UC1, at least 16 x 16. An empty or other picture gives no detections.
  void Detect(const cv::Mat& gray, Detections& out);

  /// Standard deviation of the last picture's pixel noise, gray levels.
  double noise() const { return noise_; }

 private:
  struct Run {  // of chosen pixels in a row: [begin, end)
    int y, begin, end, label;
  };
  struct Span {  // pixels of a row
    int begin, end;
  };
  struct Blob {
    int first_run = 0, runs = 0;  // in sorted_
    int area = 0, x0 = 0, x1 = 0, y0 = 0, y1 = 0;
    bool dropped = false;  // too small for anything
    bool odd = false;      // too large or too thin for one marker
  };
  struct Levels {  // gray levels of a blob and of the pixels around it
    double peak = 0, background = 0, outline = 0;
    double dark_outline = 0;  // part of the outline below half the contrast
    double contrast() const { return peak - background; }
  };
  struct Measured {
    Detection detection;
    double contrast = 0;
    Mat2 spread = Mat2::Zero();  // second moments, px^2
  };
  // How bright markers are around a place.
  struct Neighbourhoods {
    struct Cell {
      double weight = 0, contrast = 0;  // sums
    };
    void Clear(int width, int height);
    void Add(const Vec2& p, double size_px, double contrast);
    double Typical(const Vec2& p) const;
    size_t Of(const Vec2& p) const;

    int columns = 0, count = 0;
    Cell all;
    std::vector<Cell> cells;
  };

  void Resize(int width, int height);
  void EstimateNoise(const cv::Mat& gray);
  void FindBackground(const cv::Mat& gray);
  void FindRuns(const cv::Mat& gray);
  int Contrast() const { return static_cast<int>(std::lround(contrast_)); }
  void FindSpans(int row);
  void ChooseRow(const cv::Mat& gray, int y);
  void AppendRuns(int y, int x_begin, int x_end);
  int NewLabel();
  int Root(int label);
  void CollectBlobs();
  double BackgroundAt(double x, double y) const;
  void MeasureBlobs(const cv::Mat& gray, double split_level);
  void SplitAgain(const cv::Mat& gray);
  Levels MeasureLevels(const cv::Mat& gray, const Blob& blob);
  Vec2 Shade(const Blob& blob, const Levels& levels) const;
  bool Measure(const Blob& blob, const Levels& levels, Measured& measured);
  void CompleteClipped(const Blob& blob, Detection& d) const;
  void FindSummits(const Blob& blob, double base);
  void TakeBells();
  double Floor(bool small) const {
    const double sigma = small ? options_.small_sigma_floor_px : options_.sigma_floor_px;
    return sigma * sigma;
  }
  void DropDimBells();
  double BlurVariance() const;
  void DropSpecks(Detections& out);

  const DetectorOptions options_;
  int width_ = 0, height_ = 0;
  double noise_ = 1, contrast_ = 10;
  double edge_area_ = 0, edge_length_ = 0;  // of the whole, not small blobs: what is between dark and bright
  bool first_level_ = true;
  int cell_ = 8, grid_width_ = 0, grid_height_ = 0;             // background grid, cells of cell_ px
  std::vector<uint8_t> background_, grid_scratch_, brightest_;  // by cell; brightest: single pixel
  std::vector<int32_t> block_least_;                            // of a row of cells, by block
  std::vector<uint8_t> row_brightest_;                          // of a row of cells, by pixel
  std::vector<Span> spans_;
  std::vector<int16_t> column_sums_, row_background_;  // of the 7 rows around; background by column
  std::vector<uint8_t> chosen_;                        // the row's pixels that passed
  std::vector<Run> runs_, sorted_;
  std::vector<int> parents_, blob_of_label_;
  std::vector<Blob> blobs_;
  std::vector<Run> again_;
  BlobBox box_;
  BellFinder bells_;
  std::vector<Measured> measured_;
  Neighbourhoods around_;
};

}  // namespace taclink
