#pragma once

#include <string>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/yaml/yaml_reader.h"

namespace taclink {

/// Loads a link model: the name of a shipped one ("cylinder", "barrel", "cone", ...) or a path of a YAML
/// file. Errors: kNotFound (names the shipped ones), kInvalidArgument (file, line, what was expected).
Result<LinkModel> LoadLinkModel(const std::string& name_or_path);

/// Parses a model file's text; `name` stands for the file in messages.
Result<LinkModel> ParseLinkModel(const std::string& name, std::string_view content);

std::vector<std::string> ShippedModelNames();

/// A shipped model's file, to copy and change. Empty: no such model.
std::string_view ShippedModelText(const std::string& name);

/// The text of LoadLinkModel's file. Errors: kNotFound.
Result<std::string> LinkModelText(const std::string& name_or_path);

/// A model file's text with another material and what is known of it (format version 2); all else, comments
/// too, stays. `name` stands for the file in messages. Errors: kInvalidArgument: no model file;
/// kUnsupported: written in a way that can't be edited (anchors).
Result<std::string> WithMaterial(const std::string& name, const std::string& content,
                                 const Material& material, const MaterialEvidence& evidence);

/// Likewise with another relaxation of the skin.
Result<std::string> WithRelaxation(const std::string& name, const std::string& content,
                                   const Relaxation& relaxation);

/// One camera as it stands in model and calibration files. Keys: image_size_px, lens (division, the default,
/// or kannala_brandt), focal_px, principal_point_px, k1_per_px2 and k2_per_px4 (division) or fisheye_k (four
/// numbers), position_mm, rotation_deg.
CameraModel ReadCamera(YamlMap map, CameraId id);
std::string CameraText(const CameraModel& camera, CameraId id, const std::string& indent);

}  // namespace taclink
