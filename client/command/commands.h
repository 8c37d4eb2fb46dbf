#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "sensing/core/result.h"

namespace taclink::command {

/// Set by the subcommand that was chosen; main runs it and prints its error.
using Selected = std::function<Result<void>()>;

/// A number from `min` to `max`; CLI11's own check lets "nan" through.
CLI::Validator Within(double min, double max);

/// Each registers one subcommand with its options.
void AddCameras(CLI::App& app, Selected& selected);
void AddList(CLI::App& app, Selected& selected);
void AddLog(CLI::App& app, Selected& selected);
void AddRecord(CLI::App& app, Selected& selected);
void AddRestart(CLI::App& app, Selected& selected);
void AddWatch(CLI::App& app, Selected& selected);
void AddDetect(CLI::App& app, Selected& selected);
void AddSolve(CLI::App& app, Selected& selected);
void AddCalibrate(CLI::App& app, Selected& selected);
void AddSimulate(CLI::App& app, Selected& selected);
void AddSkin(CLI::App& app, Selected& selected);
void AddBench(CLI::App& app, Selected& selected);
void AddContacts(CLI::App& app, Selected& selected);
void AddJoints(CLI::App& app, Selected& selected);
void AddShow(CLI::App& app, Selected& selected);
void AddToken(CLI::App& app, Selected& selected);
void AddTare(CLI::App& app, Selected& selected);
void AddEvents(CLI::App& app, Selected& selected);
void AddThresholds(CLI::App& app, Selected& selected);

/// Likewise, below `record`.
void AddPlay(CLI::App& record, Selected& selected);

/// `--server`, or the environment variable TACLINK_SERVER, or the local default; and the options that
/// ConnectTo (connect.h) takes beside it.
void AddServerOption(CLI::App& command, std::string& address);

}  // namespace taclink::command
