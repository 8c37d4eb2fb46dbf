#include "bench/command/benchmarks.h"
#include "client/command/cli/program.h"

namespace {

void AddBenchmarks(const taclink::command::Arguments& bench, taclink::command::Selected& selected) {
  using namespace taclink::command;
  AddBenchVision(bench, selected);
  AddBenchAccuracy(bench, selected);
  AddBenchStability(bench, selected);
  AddBenchWhole(bench, selected);
  AddBenchSweep(bench, selected);
  AddBenchAcceptance(bench, selected);
  AddBenchServer(bench, selected);
  AddBenchLog(bench, selected);
}

}  // namespace

int main(int argc, char** argv) {
  return taclink::command::Run(
      {.name = "taclink-bench",
       .description = "Measures accuracy, time and stability against simulated truth, and a "
                      "server and its logs under load",
       .add_commands = AddBenchmarks},
      argc, argv);
}
