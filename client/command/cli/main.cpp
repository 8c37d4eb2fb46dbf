#include "client/command/cli/program.h"

namespace {

constexpr const char* kEnvironment =
    "Environment: TACLINK_PATIENCE_S is the least number of seconds that a server gets to answer, for\n"
    "slow machines. Without it: 3 to connect, 5 between messages of a stream, 10 or more for a call.";

void AddCommands(const taclink::command::Arguments& app, taclink::command::Selected& selected) {
  using namespace taclink::command;
  // Groups stand in the help in the order of their first commands.
  AddList(app, selected);
  AddWatch(app, selected);
  AddContacts(app, selected);
  AddEvents(app, selected);
  AddPoke(app, selected);
  AddTare(app, selected);
  AddThresholds(app, selected);
  AddPressure(app, selected);
  AddSet(app, selected);
  AddJoints(app, selected);
  AddRestart(app, selected);
  AddRecord(app, selected);
  AddLog(app, selected);
  AddDetect(app, selected);
  AddSolve(app, selected);
  AddSimulate(app, selected);
  AddSkin(app, selected);
  AddCalibrate(app, selected);
  AddAccept(app, selected);
  AddCameras(app, selected);
  AddShow(app, selected);
  AddToken(app, selected);
  AddDoctor(app, selected);
  AddCompletion(app, selected);
  app.Group("Live", {"list", "watch", "contacts", "events", "poke", "tare", "thresholds", "pressure", "set",
                     "joints", "restart"});
  app.Group("Recordings", {"record", "log"});
  app.Group("Offline", {"detect", "solve", "simulate", "skin"});
  app.Group("Setup", {"cameras", "calibrate", "accept", "show", "token", "doctor", "completion"});
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
