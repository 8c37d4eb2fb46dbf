#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "sensing/camera/projection.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {

/// Frames of a simulated link, with what is true in them. Abort where the model or the scene is no good.
class MovingSkin {
 public:
  MovingSkin(const std::string& model_name, const Scene& scene)
      : model(LoadLinkModel(model_name).value()),
        skin_(SimulatedSkin::Make(model, scene).value()),
        renderer(std::make_unique<Renderer>(model, model.nominal_rig, scene.camera, scene.seed)) {}

  /// `sequence` also picks the noise.
  const StereoFrame& Take(double time_s, uint64_t sequence) {
    skin_->Evaluate(time_s, truth);
    truth.frame = sequence;
    for (const CameraId id : kBothCameras) {
      renderer->Render(truth, id, gray_);
      PackYuyv(gray_, renderer->chroma(id), frame.images[Index(id)]);
    }
    frame.sequence = sequence;
    frame.pressure_mpa = truth.pressure_mpa;
    return frame;
  }

  struct Score {
    int visible = 0, labelled = 0, wrong = 0;  // labelled: of the visible ones
  };
  /// Wrong is a label that is nearer to another marker's true place than to its own, and further than 1.5 px
  /// from its own.
  Score Judge(const LabelledMarkers& labels) const {
    Score score;
    for (const CameraId id : kBothCameras) {
      const Projector projector(model.nominal_rig[id]);
      std::vector<Vec2> places;
      for (const Vec3& p : truth.marker_mm) {
        places.push_back(projector.Project(p).value_or(Vec2::Constant(-1e6)));
      }
      for (size_t m = 0; m < places.size(); ++m) {
        const MarkerObservation& label = labels.cameras[Index(id)][m];
        const Vec2& own = places[m];
        const bool inside = own.x() > 3 && own.y() > 3 && own.x() < 636 && own.y() < 476;
        const bool visible = inside && renderer->Sees(truth, id, static_cast<int>(m));
        score.visible += visible ? 1 : 0;
        if (!label.seen) continue;
        score.labelled += visible ? 1 : 0;
        const double off = (label.center_px - own).norm();
        bool nearer = false;
        for (const Vec2& other : places) nearer = nearer || (label.center_px - other).norm() < off;
        score.wrong += off > 1.5 && nearer ? 1 : 0;
      }
    }
    return score;
  }

  LinkModel model;
  SkinTruth truth;  // of the last frame
  StereoFrame frame;

 private:
  std::unique_ptr<SimulatedSkin> skin_;
  cv::Mat gray_;

 public:
  std::unique_ptr<Renderer> renderer;  // may be replaced, for other light
};

}  // namespace taclink
