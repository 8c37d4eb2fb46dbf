#include "sensing/camera/bundle.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <memory>
#include <utility>

namespace taclink {
namespace {

constexpr int kLensAngles = 6;  // at which a lens is held against the nominal one

// So scaled, all parameters have steps of a like size.
CameraStep Scales(LensKind kind) {
  CameraStep scales;
  scales << Vec3::Constant(1e-2), Vec3::Ones(), Vec2::Constant(10), 10, Eigen::Vector4d::Constant(1e-2);
  if (kind == LensKind::kDivision) scales.tail<4>() << 1e-6, 1e-11, 1, 1;
  return scales;
}

// A camera in work: its parameter block holds the scaled step from the start.
struct View {
  explicit View(const BundleCamera& given)
      : source(given),
        scales(Scales(given.start.lens.kind)),
        count(CameraParameterCount(given.start.lens.kind)),
        projector(given.start) {}

  void Update() {
    CameraStep step = CameraStep::Zero();
    for (int i = 0; i < count; ++i) step[i] = scales[i] * block[static_cast<size_t>(i)];
    projector = Projector(Moved(source.start, step));
  }

  const BundleCamera& source;
  const CameraStep scales;
  const int count;
  std::array<double, kCameraParameters> block{};
  Projector projector;  // of the block's present values
};

// Projectors are made once an evaluation, not once a residual.
class UpdateViews final : public ceres::EvaluationCallback {
 public:
  explicit UpdateViews(std::vector<View>& views) : views_(views) {}
  void PrepareForEvaluation(bool, bool new_point) override {
    if (!new_point) return;
    for (View& view : views_) view.Update();
  }

 private:
  std::vector<View>& views_;
};

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// A sample's residual over its sigmas; blocks: the camera, and the marker's shift if markers move.
class SampleCost final : public ceres::CostFunction {
 public:
  SampleCost(const View& view, const BundleSample& sample, bool move_marker) : view_(view), sample_(sample) {
    set_num_residuals(2);
    mutable_parameter_block_sizes()->push_back(view.count);
    if (move_marker) mutable_parameter_block_sizes()->push_back(3);
    whiten_ = sample.covariance_px2.llt().matrixL().solve(Mat2::Identity());
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const bool moves = parameter_block_sizes().size() == 2;
    const Vec3 shift = moves ? Vec3(blocks[1][0], blocks[1][1], blocks[1][2]) : Vec3(Vec3::Zero());
    const Vec3 at = sample_.rest_mm + shift;
    Eigen::Map<Vec2> residual(residuals);
    if (!jacobians) {
      const auto pixel = view_.projector.Project(at);
      if (pixel) residual = whiten_ * (*pixel - sample_.pixel);
      return pixel.has_value();
    }
    const auto seen = view_.projector.ProjectWithCameraJacobian(at);
    if (!seen) return false;
    residual = whiten_ * (seen->pixel - sample_.pixel);
    if (jacobians[0]) {
      Eigen::Map<RowMajor>(jacobians[0], 2, view_.count) =
          whiten_ * seen->by_camera.leftCols(view_.count) * view_.scales.head(view_.count).asDiagonal();
    }
    if (moves && jacobians[1]) Eigen::Map<RowMajor>(jacobians[1], 2, 3) = whiten_ * seen->by_point;
    return true;
  }

 private:
  const View& view_;
  const BundleSample& sample_;
  Mat2 whiten_;
};

// How far a camera is off its nominal one: turn, place and principal point over their tolerances, then the
// lens at some angles.
class BuildCost final : public ceres::CostFunction {
 public:
  BuildCost(const View& view, const BuildTolerance& tolerance) : view_(view) {
    mutable_parameter_block_sizes()->push_back(view.count);
    sigmas_ << tolerance.tilt_rad, tolerance.tilt_rad, tolerance.roll_rad, Vec3::Constant(tolerance.place_mm),
        Vec2::Constant(tolerance.principal_point_px);
    const Projector nominal(view.source.nominal);
    double widest = 0;
    for (const BundleSample& sample : view.source.samples) {
      const Vec3 p = view.source.nominal.camera_from_link * sample.rest_mm;
      widest = std::max(widest, std::atan2(p.head<2>().norm(), p.z()));
    }
    for (int i = 1; i <= kLensAngles; ++i) {
      const double theta = widest * i / kLensAngles;
      const auto radius = nominal.lens().AtAngle(theta);
      if (!radius || radius->px <= 0) continue;
      angles_.push_back({theta, radius->px, tolerance.lens * radius->px * std::sqrt(double{kLensAngles})});
    }
    set_num_residuals(8 + static_cast<int>(angles_.size()));
  }

  /// Whether the view's lens reaches as far as the residuals ask.
  bool Defined() const {
    return std::all_of(angles_.begin(), angles_.end(),
                       [&](const Angle& one) { return view_.projector.lens().AtAngle(one.theta); });
  }

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    const CameraModel& camera = view_.projector.model();
    CameraModel nominal = view_.source.nominal;
    nominal.lens.kind = camera.lens.kind;  // the lens is held below
    Eigen::Map<Eigen::VectorXd> residual(residuals, num_residuals());
    residual.head<8>() = StepBetween(nominal, camera).head<8>().cwiseQuotient(sigmas_);
    RowMajor jacobian = RowMajor::Zero(num_residuals(), view_.count);
    jacobian.leftCols<8>().topRows<8>().diagonal() = sigmas_.cwiseInverse();  // small turns add up
    for (size_t i = 0; i < angles_.size(); ++i) {
      const auto radius = view_.projector.lens().AtAngle(angles_[i].theta);
      if (!radius) return false;
      const auto row = static_cast<Eigen::Index>(8 + i);
      residual[row] = (radius->px - angles_[i].radius_px) / angles_[i].sigma_px;
      jacobian.row(row).tail(view_.count - 8) = view_.projector.lens()
                                                    .RadiusByParameters(angles_[i].theta, radius->px)
                                                    .head(view_.count - 8)
                                                    .transpose() /
                                                angles_[i].sigma_px;
    }
    if (jacobians && jacobians[0]) {
      Eigen::Map<RowMajor>(jacobians[0], num_residuals(), view_.count) =
          jacobian * view_.scales.head(view_.count).asDiagonal();
    }
    return true;
  }

 private:
  struct Angle {
    double theta, radius_px, sigma_px;
  };
  const View& view_;
  Eigen::Matrix<double, 8, 1> sigmas_;
  std::vector<Angle> angles_;
};

// A marker is where the model has it, displaced by the modes, within the mould's tolerance. Blocks: its shift
// and, if there are any, the modes' shares.
class MouldCost final : public ceres::CostFunction {
 public:
  MouldCost(double sigma_mm, Eigen::MatrixXd modes_mm)
      : per_sigma_(1 / sigma_mm), modes_mm_(std::move(modes_mm)) {
    set_num_residuals(3);
    mutable_parameter_block_sizes()->push_back(3);
    if (modes_mm_.cols() > 0) mutable_parameter_block_sizes()->push_back(static_cast<int>(modes_mm_.cols()));
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Index modes = modes_mm_.cols();
    Vec3 shift(blocks[0][0], blocks[0][1], blocks[0][2]);
    if (modes > 0) shift -= modes_mm_ * Eigen::Map<const Eigen::VectorXd>(blocks[1], modes);
    Eigen::Map<Vec3> residual(residuals);
    residual = per_sigma_ * shift;
    if (jacobians && jacobians[0]) Eigen::Map<Mat3>(jacobians[0], 3, 3) = per_sigma_ * Mat3::Identity();
    if (jacobians && modes > 0 && jacobians[1])
      Eigen::Map<RowMajor>(jacobians[1], 3, modes) = -per_sigma_ * modes_mm_;
    return true;
  }

 private:
  double per_sigma_;
  Eigen::MatrixXd modes_mm_;
};

// Shares are of unit variance.
class ShareCost final : public ceres::CostFunction {
 public:
  explicit ShareCost(int count) {
    set_num_residuals(count);
    mutable_parameter_block_sizes()->push_back(count);
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const int count = num_residuals();
    std::copy_n(blocks[0], count, residuals);
    if (jacobians && jacobians[0]) Eigen::Map<RowMajor>(jacobians[0], count, count).setIdentity();
    return true;
  }
};

class Adjustment {
 public:
  Adjustment(std::span<const BundleCamera> cameras, const BundleOptions& options)
      : options_(options), callback_(views_), problem_(ProblemOptions(callback_)) {
    views_.reserve(cameras.size());
    for (const BundleCamera& camera : cameras) {
      views_.emplace_back(camera);
      for (const BundleSample& s : camera.samples)
        shifts_.resize(std::max(shifts_.size(), static_cast<size_t>(s.marker) + 1), Vec3::Zero());
    }
    shares_.resize(static_cast<size_t>(options.modes_mm.cols()), 0);
    for (View& view : views_) AddCamera(view);
    if (options.move_markers) AddMarkers();
  }

  BundleResult Run() {
    BundleResult result;
    if (!can_start_) {
      for (const View& view : views_) result.cameras.push_back(view.source.start);
      return result;
    }
    ceres::Solver::Options solver;
    solver.linear_solver_type = options_.move_markers ? ceres::DENSE_SCHUR : ceres::DENSE_QR;
    solver.max_num_iterations = options_.max_steps;
    solver.function_tolerance = 1e-9;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
    result.converged = summary.termination_type == ceres::CONVERGENCE;
    result.cost = summary.final_cost;
    result.steps = summary.num_successful_steps + summary.num_unsuccessful_steps;
    ceres::Problem::EvaluateOptions only_build;
    only_build.residual_blocks = build_blocks_;
    problem_.Evaluate(only_build, &result.tolerance_cost, nullptr, nullptr, nullptr);
    for (View& view : views_) {
      view.Update();
      result.cameras.push_back(view.projector.model());
    }
    result.marker_shift_mm = shifts_;
    result.mode_shares = Eigen::Map<const Eigen::VectorXd>(shares_.data(), options_.modes_mm.cols());
    if (options_.with_covariance && summary.IsSolutionUsable()) WriteCovariances(result);
    return result;
  }

 private:
  static ceres::Problem::Options ProblemOptions(UpdateViews& callback) {
    ceres::Problem::Options options;
    options.evaluation_callback = &callback;
    return options;
  }

  void AddCamera(View& view) {
    auto* build = new BuildCost(view, options_.tolerance);
    can_start_ = can_start_ && build->Defined();
    build_blocks_.push_back(problem_.AddResidualBlock(build, nullptr, view.block.data()));
    for (const BundleSample& sample : view.source.samples) {
      can_start_ = can_start_ && view.projector.Project(sample.rest_mm);
      auto* cost = new SampleCost(view, sample, options_.move_markers);
      auto* loss = new ceres::CauchyLoss(options_.loss_width);
      if (options_.move_markers) {
        problem_.AddResidualBlock(cost, loss, view.block.data(),
                                  shifts_[static_cast<size_t>(sample.marker)].data());
      } else {
        problem_.AddResidualBlock(cost, loss, view.block.data());
      }
    }
  }

  void AddMarkers() {
    for (Vec3& shift : shifts_) {
      if (!problem_.HasParameterBlock(shift.data())) continue;
      const auto first = 3 * (&shift - shifts_.data());
      if (!HasModes()) {
        problem_.AddResidualBlock(new MouldCost(options_.tolerance.marker_mm, {}), nullptr, shift.data());
        continue;
      }
      problem_.AddResidualBlock(
          new MouldCost(options_.tolerance.marker_mm, options_.modes_mm.middleRows<3>(first)), nullptr,
          shift.data(), shares_.data());
    }
    if (HasModes())
      problem_.AddResidualBlock(new ShareCost(static_cast<int>(shares_.size())), nullptr, shares_.data());
  }
  bool HasModes() const { return options_.modes_mm.cols() > 0; }

  void WriteCovariances(BundleResult& result) {
    ceres::Covariance::Options options;
    options.algorithm_type = ceres::SPARSE_QR;
    options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    ceres::Covariance covariance(options);
    std::vector<const double*> blocks;
    std::vector<std::pair<const double*, const double*>> pairs;
    Eigen::Index rows = 0;
    for (const View& view : views_) {
      blocks.push_back(view.block.data());
      for (const double* other : blocks) pairs.emplace_back(other, view.block.data());
      rows += view.count;
    }
    const bool has_modes = HasModes() && problem_.HasParameterBlock(shares_.data());
    if (has_modes) pairs.emplace_back(shares_.data(), shares_.data());
    RowMajor scaled(rows, rows);
    if (!covariance.Compute(pairs, &problem_) || !covariance.GetCovarianceMatrix(blocks, scaled.data()))
      return;
    result.covariance = Unscaled(scaled);
    if (!has_modes) return;
    const auto modes = static_cast<Eigen::Index>(shares_.size());
    RowMajor of_shares(modes, modes);
    if (covariance.GetCovarianceBlock(shares_.data(), shares_.data(), of_shares.data()))
      result.mode_covariance = of_shares;
  }

  // From the blocks' parameters to 13 a camera, in their own units.
  Eigen::MatrixXd Unscaled(const RowMajor& scaled) const {
    const auto size = static_cast<Eigen::Index>(views_.size()) * kCameraParameters;
    Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(size, scaled.rows());
    Eigen::Index row = 0, column = 0;
    for (const View& view : views_) {
      for (int i = 0; i < view.count; ++i) spread(row + i, column + i) = view.scales[i];
      row += kCameraParameters;
      column += view.count;
    }
    return spread * scaled * spread.transpose();
  }

  const BundleOptions options_;
  bool can_start_ = true;
  std::vector<View> views_;
  std::vector<Vec3> shifts_;
  std::vector<double> shares_;  // of the modes
  UpdateViews callback_;
  ceres::Problem problem_;
  std::vector<ceres::ResidualBlockId> build_blocks_;
};

}  // namespace

BundleResult AdjustBundle(std::span<const BundleCamera> cameras, const BundleOptions& options) {
  return Adjustment(cameras, options).Run();
}

}  // namespace taclink
