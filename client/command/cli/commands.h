#pragma once

#include <functional>
#include <string>

#include "client/command/cli/arguments.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// Set by the subcommand that was chosen; main runs it and prints its error.
using Selected = std::function<Result<void>()>;

/// Each registers one subcommand with its options.
void AddAccept(const Arguments& app, Selected& selected);
void AddDoctor(const Arguments& app, Selected& selected);
void AddCompletion(const Arguments& app, Selected& selected);
void AddCameras(const Arguments& app, Selected& selected);
void AddList(const Arguments& app, Selected& selected);
void AddLog(const Arguments& app, Selected& selected);
void AddPoke(const Arguments& app, Selected& selected);
void AddRecord(const Arguments& app, Selected& selected);
void AddRestart(const Arguments& app, Selected& selected);
void AddWatch(const Arguments& app, Selected& selected);
void AddDetect(const Arguments& app, Selected& selected);
void AddSolve(const Arguments& app, Selected& selected);
void AddCalibrate(const Arguments& app, Selected& selected);
void AddSimulate(const Arguments& app, Selected& selected);
void AddSkin(const Arguments& app, Selected& selected);
void AddContacts(const Arguments& app, Selected& selected);
void AddJoints(const Arguments& app, Selected& selected);
void AddShow(const Arguments& app, Selected& selected);
void AddToken(const Arguments& app, Selected& selected);
void AddTare(const Arguments& app, Selected& selected);
void AddEvents(const Arguments& app, Selected& selected);
void AddSet(const Arguments& app, Selected& selected);
void AddThresholds(const Arguments& app, Selected& selected);
void AddPressure(const Arguments& app, Selected& selected);

/// Likewise, below `record`.
void AddPlay(const Arguments& record, Selected& selected);

/// `--server`, or the environment variable TACLINK_SERVER, or the local default; and the options that
/// ConnectTo (connect.h) takes beside it.
void AddServerOption(const Arguments& command, std::string& address);

}  // namespace taclink::command
