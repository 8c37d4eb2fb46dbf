#include "client/command/cli/program.h"

namespace {

constexpr const char* kEnvironment =
    "Environment: TACLINK_PATIENCE_S is the least number of seconds that a server gets to answer, for\n"
    "slow machines. Without it: 3 to connect, 5 between messages of a stream, 10 or more for a call.";

void AddCommands(const taclink::command::Arguments& app, taclink::command::Selected& selected) {
  using namespace taclink::command;
  AddCameras(app, selected);
  AddList(app, selected);
  AddLog(app, selected);
  AddPoke(app, selected);
  AddRecord(app, selected);
  AddRestart(app, selected);
  AddWatch(app, selected);
  AddDetect(app, selected);
  AddSolve(app, selected);
  AddCalibrate(app, selected);
  AddSimulate(app, selected);
  AddSkin(app, selected);
  AddContacts(app, selected);
  AddJoints(app, selected);
  AddShow(app, selected);
  AddToken(app, selected);
  AddTare(app, selected);
  AddEvents(app, selected);
  AddThresholds(app, selected);
  AddSet(app, selected);
}

}  // namespace

int main(int argc, char** argv) {
  return taclink::command::Run(
      {.name = "taclink",
       .description = "Looks at soft tactile links: live from a server, or offline from files",
       .footer = kEnvironment,
       .add_commands = AddCommands},
      argc, argv);
}
