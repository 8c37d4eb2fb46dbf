// Every stage from two pictures in memory to contacts, the whole way, and the simulation that makes the
// pictures. One core. "touched": 0.2 N at one marker; "rest": nothing moves.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdlib>
#include <opencv2/core.hpp>

#include "sensing/capture/decode.h"
#include "sensing/contact/contact_finder.h"
#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/path_tracker.h"
#include "sensing/markers/track/marker_tracker.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/pipeline/skin_stage.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

constexpr double kRestS = 0, kTouchedS = 3;

Scene NonlinearPress() {
  Scene scene = LoadScene("press").value();
  scene.skin = SkinKind::kNonlinear;
  return scene;
}

// One link with its pictures at rest and touched.
struct PipelineBench {
  explicit PipelineBench(const std::string& model_name)
      : model(LoadLinkModel(model_name).value()),
        scene(NonlinearPress()),
        skin(SimulatedSkin::Make(model, scene).value()),
        renderer(model, model.nominal_rig, scene.camera, 1) {
    cv::setNumThreads(1);
    Take(kRestS, rest);
    Take(kTouchedS, touched);
  }

  void Take(double time_s, StereoFrame& frame) {
    skin->Evaluate(time_s, truth);
    for (const CameraId id : kBothCameras) {
      renderer.Render(truth, id, gray);
      PackYuyv(gray, renderer.chroma(id), frame.images[Index(id)]);
    }
    frame.pressure_mpa = 0;
  }

  LinkPipeline CalibratedPipeline() const {
    PipelineOptions options;
    options.rest_frames = 1;
    LinkPipeline pipeline(model, options);
    LinkState state;
    pipeline.Process(rest, state);
    if (!pipeline.calibration()) std::abort();
    return pipeline;
  }

  LinkModel model;
  Scene scene;
  std::unique_ptr<SimulatedSkin> skin;
  Renderer renderer;
  SkinTruth truth;
  cv::Mat gray;
  StereoFrame rest, touched;
};

PipelineBench& For(const benchmark::State& state) {
  static PipelineBench cylinder("cylinder"), barrel("barrel");
  return state.range(0) == 0 ? cylinder : barrel;
}

// What one stage hands to the next, for the touched pictures.
struct Stages {
  explicit Stages(const PipelineBench& bench)
      : pipeline(bench.CalibratedPipeline()),
        tracker(bench.model, pipeline.calibration()->rig),
        skin(bench.model, *pipeline.calibration(), {}),
        estimator(MakeStateEstimator(bench.model, {})),
        finder(bench.model) {
    for (const StereoFrame* frame : {&bench.rest, &bench.touched}) {
      for (size_t i = 0; i < kCameraCount; ++i) {
        if (!decoder.Decode(frame->images[i], gray[i])) std::abort();
        detector.Detect(gray[i], detections[i]);
      }
      tracker.Label(detections, labels);
      if (frame == &bench.rest)
        skin.SetBaseline(labels, {}, Eigen::VectorXd::Zero(3 * bench.model.markers.count()));
      Estimate();
    }
  }

  void Estimate() {
    MeasuredLoads told{0, PressureSigma(PressureOrigin::kSimulated)};
    skin.Run(labels, told, {}, *estimator, finder, state, told);
  }

  LinkPipeline pipeline;
  GrayDecoder decoder;
  MarkerDetector detector;
  std::array<cv::Mat, kCameraCount> gray;
  std::array<Detections, kCameraCount> detections;
  PathTracker tracker;
  LabelledMarkers labels;
  SkinStage skin;
  std::unique_ptr<StateEstimator> estimator;
  ContactFinder finder;
  LinkState state;
};

void Decode(benchmark::State& state) {
  PipelineBench& bench = For(state);
  Stages s(bench);
  for (auto _ : state) {
    for (size_t i = 0; i < kCameraCount; ++i) {
      if (!s.decoder.Decode(bench.touched.images[i], s.gray[i])) std::abort();
    }
  }
}

void Detect(benchmark::State& state) {
  Stages s(For(state));
  for (auto _ : state) {
    for (size_t i = 0; i < kCameraCount; ++i) s.detector.Detect(s.gray[i], s.detections[i]);
  }
}

void Register(benchmark::State& state) {
  Stages s(For(state));
  for (auto _ : state) s.tracker.Label(s.detections, s.labels);
}

// Frames that follow one another: nothing moves, or a dent of 8 mm comes, slides at 30 mm/s and goes.
void Track(benchmark::State& state, bool moving) {
  PipelineBench& bench = For(state);
  Scene scene = bench.scene;
  scene.contacts.clear();
  if (moving) {
    SceneContact contact;
    contact.at = {.angle_rad = 1, .z_mm = 60};
    contact.move_to = SkinPlace{.angle_rad = 1.3, .z_mm = 130};
    contact.patch_diameter_mm = 12;
    contact.depth_mm = 8;
    contact.begin_s = 0.2, contact.end_s = 2.6, contact.ramp_s = 0.4;
    scene.contacts.push_back(contact);
  }
  const auto skin = SimulatedSkin::Make(bench.model, scene).value();
  LinkPipeline pipeline = bench.CalibratedPipeline();
  MarkerDetector detector;
  PathTracker acquirer(bench.model, pipeline.calibration()->rig);
  MarkerTracker tracker(bench.model, pipeline.calibration()->rig);
  std::vector<MarkerTracker::Pictures> frames;
  for (int k = 0; k < 84; ++k) {
    MarkerTracker::Pictures pictures;
    skin->Evaluate(k / 30.0, bench.truth);
    for (const CameraId id : kBothCameras) bench.renderer.Render(bench.truth, id, pictures[Index(id)]);
    frames.push_back(pictures);
  }
  std::array<Detections, kCameraCount> detections;
  LabelledMarkers acquired, labels;
  TrackingReport report;
  for (size_t i = 0; i < kCameraCount; ++i) detector.Detect(frames[0][i], detections[i]);
  acquirer.Label(detections, acquired);
  tracker.Adopt(frames[0], acquired, labels, report);
  double share = 0, measured = 0, count = 0;
  size_t next = 0;
  for (auto _ : state) {
    tracker.Follow(frames[next], {}, report);
    tracker.Check(labels, report);
    next = (next + 1) % frames.size();
    count += kCameraCount;
    for (const CameraTracking& camera : report.cameras) {
      share += camera.share_read;
      measured += camera.measured;
    }
  }
  state.counters["share_read"] = share / count;
  state.counters["measured"] = measured / count;
}

// Shape, pressure, forces and contacts.
void Estimate(benchmark::State& state) {
  Stages s(For(state));
  for (auto _ : state) s.Estimate();
  state.counters["contacts"] = static_cast<double>(s.state.contacts.size());
}

void Whole(benchmark::State& state, StereoFrame PipelineBench::* frame) {
  PipelineBench& bench = For(state);
  LinkPipeline pipeline = bench.CalibratedPipeline();
  LinkState result;
  for (auto _ : state) pipeline.Process(bench.*frame, result);
  state.counters["contacts"] = static_cast<double>(result.contacts.size());
  state.counters["seen"] = result.shape.seen();
}

void Simulate(benchmark::State& state) {
  PipelineBench& bench = For(state);
  StereoFrame frame;
  for (auto _ : state) bench.Take(kTouchedS, frame);
}

void BothModels(benchmark::internal::Benchmark* benchmark) {
  benchmark->Arg(0)->Arg(1)->ArgName("barrel")->Unit(benchmark::kMillisecond);
}

BENCHMARK(Decode)->Apply(BothModels);
BENCHMARK(Detect)->Apply(BothModels);
BENCHMARK(Register)->Apply(BothModels);
BENCHMARK_CAPTURE(Track, rest, false)->Apply(BothModels);
BENCHMARK_CAPTURE(Track, moving, true)->Apply(BothModels);
BENCHMARK(Estimate)->Apply(BothModels);
BENCHMARK_CAPTURE(Whole, rest, &PipelineBench::rest)->Apply(BothModels);
BENCHMARK_CAPTURE(Whole, touched, &PipelineBench::touched)->Apply(BothModels);
BENCHMARK(Simulate)->Apply(BothModels);

}  // namespace
}  // namespace taclink
