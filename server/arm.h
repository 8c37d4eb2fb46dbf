#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_model.h"
#include "server/hub.h"
#include "server/link_worker.h"

namespace taclink::server {

enum class SourceKind { kV4l2, kFiles, kSimulated };

/// What clients are told about a link that does not change while the server runs.
struct LinkDescription {
  std::string name;  ///< unique within the arm
  LinkModel model;
  Rigid3 base_from_link = {};  ///< mm
  SourceKind source = SourceKind::kSimulated;
};

/// What a link is made of.
struct LinkParts {
  LinkDescription description;
  std::unique_ptr<FrameSource> source;
  std::unique_ptr<LinkProcessor> processor;
};

/// All links of an arm, running, and the hub that hands out what they feel.
class Arm {
 public:
  Arm(std::string name, std::vector<LinkParts> links, FrameEncoder encoder, Clock& clock,
      LinkWorkerOptions options = {});

  void Start();
  void Stop();

  const std::string& name() const { return name_; }
  const std::vector<LinkDescription>& links() const { return links_; }
  LinkWorker& worker(size_t link) { return *workers_[link]; }
  const LinkWorker& worker(size_t link) const { return *workers_[link]; }
  Hub& hub() { return hub_; }
  const Hub& hub() const { return hub_; }

 private:
  // Constant after construction.
  const std::string name_;
  std::vector<LinkDescription> links_;
  Hub hub_;
  std::vector<std::unique_ptr<LinkWorker>> workers_;  // by link
};

}  // namespace taclink::server
