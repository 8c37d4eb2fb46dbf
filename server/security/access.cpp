#include "server/security/access.h"

#include <algorithm>

namespace taclink::server {
namespace {

constexpr AccessRule kTable[] = {
    {"/taclink.v1.TactileService/GetArm", Role::kViewer},
    {"/taclink.v1.TactileService/GetForceHistory", Role::kViewer},
    {"/taclink.v1.TactileService/StreamFrames", Role::kViewer},
    {"/taclink.v1.TactileService/StreamContacts", Role::kViewer},
    {"/taclink.v1.TactileService/StreamEvents", Role::kViewer},
    {"/taclink.v1.TactileService/SetThresholds", Role::kOperator},
    {"/taclink.v1.TactileService/UpdateJointStates", Role::kOperator},
    {"/taclink.v1.TactileService/UpdatePressure", Role::kOperator},
    {"/taclink.v1.TactileService/UpdateAttitude", Role::kOperator},
    {"/taclink.v1.TactileService/Calibrate", Role::kOperator},
    {"/taclink.v1.TactileService/Tare", Role::kOperator},
    {"/taclink.v1.TactileService/StreamPreview", Role::kViewer},
    {"/taclink.v1.TactileService/SetForceModel", Role::kOperator},
    {"/taclink.v1.TactileService/SetCamera", Role::kOperator},
    {"/taclink.v1.OperationsService/RestartLink", Role::kOperator},
    {"/taclink.v1.OperationsService/GetCaller", Role::kNobody},
    {"/taclink.v1.PressureService/SetPressure", Role::kOperator},
    {"/taclink.v1.PressureService/GetPressure", Role::kViewer},
    {"/taclink.v1.SimulationService/Press", Role::kOperator},
    {"/taclink.v1.SimulationService/Release", Role::kOperator},
    {"/taclink.v1.SimulationService/SetScenePressure", Role::kOperator},
    {"/taclink.v1.SimulationService/MoveSceneJoint", Role::kOperator},
    {"/taclink.v1.AcceptanceService/StartAcceptance", Role::kOperator},
    {"/taclink.v1.AcceptanceService/MeasureTrial", Role::kOperator},
    {"/taclink.v1.AcceptanceService/SkipTrial", Role::kOperator},
    {"/taclink.v1.AcceptanceService/FinishAcceptance", Role::kOperator},
    {"/taclink.v1.AcceptanceService/GetAcceptance", Role::kViewer},
    {"/taclink.v1.RecordingService/StartRecording", Role::kOperator},
    {"/taclink.v1.RecordingService/StopRecording", Role::kOperator},
    {"/taclink.v1.RecordingService/DeleteLog", Role::kOperator},
    {"/taclink.v1.RecordingService/GetRecorder", Role::kViewer},
    {"/taclink.v1.RecordingService/ListLogs", Role::kViewer},
    {"/taclink.v1.RecordingService/DescribeLog", Role::kViewer},
    {"/taclink.v1.RecordingService/DownloadLog", Role::kViewer},
    {"/taclink.v1.RecordingService/Replay", Role::kViewer},
    {"/taclink.v1.RecordingService/ControlReplay", Role::kViewer},
    {"/taclink.v1.RecordingService/GetReplayPictures", Role::kViewer},
    {"/grpc.health.v1.Health/Check", Role::kNobody},
    {"/grpc.health.v1.Health/Watch", Role::kNobody},
    {"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", Role::kViewer},
    // Is not there: clients that ask for it first are to hear that, and fall back.
    {"/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", Role::kViewer},
    {"/healthz", Role::kNobody},
    {"/readyz", Role::kNobody},
    {"/metrics", Role::kViewer},
};

}  // namespace

std::span<const AccessRule> AccessTable() {
  return kTable;
}

Role NeededRole(std::string_view path) {
  const auto* const rule =
      std::find_if(std::begin(kTable), std::end(kTable), [&](const auto& each) { return each.path == path; });
  return rule == std::end(kTable) ? Role::kOperator : rule->role;
}

}  // namespace taclink::server
