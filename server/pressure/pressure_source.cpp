#include "server/pressure/pressure_source.h"

namespace taclink::server {
namespace {

class AssumedPressure final : public PressureSource {
 public:
  explicit AssumedPressure(std::optional<double> mpa) : mpa_(mpa) {}

  void Apply(StereoFrame& frame) override {
    PressureReport& report = frame.pressure;
    report.stale = false;
    report.trouble.clear();
    report.mpa = frame.pressure_mpa.value_or(mpa_.value_or(0));
    report.age_ns = frame.pressure_mpa ? 0 : -1;
    report.origin = frame.pressure_mpa ? PressureOrigin::kSimulated
                    : mpa_             ? PressureOrigin::kConstant
                                       : PressureOrigin::kNone;
  }

 private:
  const std::optional<double> mpa_;
};

}  // namespace

Result<bool> PressureSource::Tell(double, int64_t) {
  return Error{ErrorCode::kFailedPrecondition,
               "the link's pressure does not come from clients; configure pressure: {source: grpc}"};
}

Result<PressureController*> PressureSource::Controller() {
  return Error{
      ErrorCode::kFailedPrecondition,
      "the link has no pressure regulator; configure pressure: {source: regulator} (docs/pressure.md)"};
}

std::unique_ptr<PressureSource> MakeAssumedPressure(std::optional<double> mpa) {
  return std::make_unique<AssumedPressure>(mpa);
}

}  // namespace taclink::server
