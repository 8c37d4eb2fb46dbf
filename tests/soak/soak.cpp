// A server under faults and clients that come and go, all at random from a seed. Fails if a client is told
// something wrong, if memory grows, or if the server does not serve at the end.
#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <stdexcept>
#include <thread>
#include <vector>

#include "sensing/model/model_file.h"
#include "server/arm/arm.h"
#include "server/hub/encoder.h"
#include "server/rpc/rpc_server.h"
#include "tests/server/test_state.h"
#include "tests/soak/faulty_source.h"
#include "tests/soak/soak_client.h"
#include "tests/support/memory.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr size_t kLinks = 3;
constexpr double kRateHz = 150;
constexpr size_t kClients = 8;
constexpr double kGrowthMb =
    32;  // over the whole run; noise of the allocator and of clients that come and go

struct Options {
  double seconds = 20;
  double minutes = 0;
  uint64_t seed = 1;
};

/// Numbers what it processed, from 1, in the pressure. Throws now and then, but not on link 0.
class SoakProcessor final : public LinkProcessor {
 public:
  SoakProcessor(size_t link, uint64_t seed) : link_(link), random_(seed) {}

  void Process(const StereoFrame& frame, LinkState& state) override {
    if (link_ != 0 && random_() % 500 == 0) throw std::runtime_error("singular matrix");
    FillTestState(link_, frame.sequence % 10, state);
    state.pressure_mpa = static_cast<double>(++order_) * 1e-6;
    state.times = frame.times;
    if (random_() % 300 == 0) std::this_thread::sleep_for(milliseconds(random_() % 60));
  }
  Result<void> BeginCalibration(const CalibrationOrder&) override { return {}; }
  CalibrationProgress PollCalibration() override {
    return {.taken = 0, .wanted = 0, .end = Error{ErrorCode::kUnsupported, "no cameras"}};
  }
  void CancelCalibration() override {}

 private:
  const size_t link_;
  std::mt19937_64 random_;
  uint64_t order_ = 0;
};

std::unique_ptr<Arm> MakeArm(uint64_t seed, FaultCounts& faults) {
  const auto model = LoadLinkModel("barrel");
  std::vector<LinkParts> parts;
  std::vector<std::string> names;
  for (size_t link = 0; link < kLinks; ++link) {
    names.push_back("link" + std::to_string(link));
    parts.push_back({.description = {.name = names.back(), .model = model.value()},
                     .source = std::make_unique<FaultySource>(kRateHz, seed + link, SystemClock(), faults),
                     .processor = std::make_unique<SoakProcessor>(link, seed + 100 + link)});
  }
  return std::make_unique<Arm>("soak", std::move(parts), MakeEncoder(names), SystemClock(),
                               ArmOptions{.worker = {.poll = milliseconds(20),
                                                     .supervisor = {.first_backoff = milliseconds(20),
                                                                    .longest_backoff = milliseconds(200)}}});
}

/// Memory over time, once everything has been used.
class MemoryWatch {
 public:
  void Sample(double time_s) {
    times_s_.push_back(time_s);
    megabytes_.push_back(testing::ResidentMb());
  }
  // Slope of the line through all samples, by least squares, times their span.
  double GrowthMb() const {
    const auto n = static_cast<double>(times_s_.size());
    double mean_t = 0, mean_m = 0, tt = 0, tm = 0;
    for (size_t i = 0; i < times_s_.size(); ++i) {
      mean_t += times_s_[i] / n;
      mean_m += megabytes_[i] / n;
    }
    for (size_t i = 0; i < times_s_.size(); ++i) {
      tt += (times_s_[i] - mean_t) * (times_s_[i] - mean_t);
      tm += (times_s_[i] - mean_t) * (megabytes_[i] - mean_m);
    }
    return tt > 0 ? tm / tt * (times_s_.back() - times_s_.front()) : 0;
  }
  double first_mb() const { return megabytes_.empty() ? 0 : megabytes_.front(); }
  double last_mb() const { return megabytes_.empty() ? 0 : megabytes_.back(); }

 private:
  std::vector<double> times_s_, megabytes_;
};

// Every link's frames reach a new client, and its last status agrees with what it got.
void CheckThatItServes(RpcServer& server, Complaints& complaints) {
  auto connection = client::Client::Connect(server.address(), std::chrono::seconds(60));
  if (!connection) return complaints.Add("at the end: " + connection.error().message);
  v1::StreamFramesRequest every;
  every.set_delivery(v1::DELIVERY_EVERY);
  const auto reader = connection->StreamFrames(every, std::chrono::seconds(60));
  if (!reader) return complaints.Add("at the end: " + reader.error().message);
  std::map<std::string, uint64_t> received;
  const auto take = [&] {
    auto frame = (*reader)->Next(std::chrono::seconds(60));
    if (frame) ++received[frame->link()];
    return frame;
  };
  while (received.size() < kLinks) {
    const auto frame = take();
    if (!frame) return complaints.Add("at the end: " + frame.error().message);
  }
  std::thread stop([&] { server.Shutdown("end of the test", std::chrono::seconds(60)); });
  auto frame = take();
  while (frame.ok()) frame = take();
  stop.join();
  if (frame.error().message.find("end of the test") == std::string::npos)
    complaints.Add("the end was not told: " + frame.error().message);
  for (const v1::LinkStreamCounts& told : (*reader)->status().links()) {
    if (told.frames_sent() != received[told.link()]) complaints.Add("the last status does not fit what came");
  }
}

int Run(const Options& options) {
  const double seconds = options.minutes > 0 ? options.minutes * 60 : options.seconds;
  FaultCounts faults;
  Complaints complaints;
  ClientCounts counts;
  const auto arm = MakeArm(options.seed, faults);
  // Fewer streams than clients, so that some are refused.
  const auto server =
      RpcServer::Start("127.0.0.1:0", *arm, {.max_streams = kClients - 2, .queue_messages = 16});
  if (!server) throw std::runtime_error(server.error().message);
  arm->Start();
  const auto begin = steady_clock::now();
  const auto end =
      begin + std::chrono::duration_cast<steady_clock::duration>(std::chrono::duration<double>(seconds));
  std::vector<std::thread> clients;
  for (size_t i = 0; i < kClients; ++i)
    clients.emplace_back(
        [&, i] { RunSoakClient((*server)->address(), options.seed + 1000 + i, end, complaints, counts); });
  MemoryWatch memory;
  while (steady_clock::now() < end) {
    std::this_thread::sleep_for(milliseconds(500));
    const double time_s = std::chrono::duration<double>(steady_clock::now() - begin).count();
    if (time_s > 0.3 * seconds || time_s > 120) memory.Sample(time_s);
  }
  for (std::thread& client : clients) client.join();
  CheckThatItServes(**server, complaints);
  arm->Stop();

  std::printf(
      "%.0f s, seed %llu: %llu stalls, %llu errors, %llu exceptions, %llu bursts, %llu refused starts\n",
      seconds, static_cast<unsigned long long>(options.seed), static_cast<unsigned long long>(faults.stalls),
      static_cast<unsigned long long>(faults.errors), static_cast<unsigned long long>(faults.exceptions),
      static_cast<unsigned long long>(faults.bursts), static_cast<unsigned long long>(faults.refused_starts));
  std::printf("%llu streams, %llu refused, %llu frames, %llu dropped in %llu statuses\n",
              static_cast<unsigned long long>(counts.streams),
              static_cast<unsigned long long>(counts.refused), static_cast<unsigned long long>(counts.frames),
              static_cast<unsigned long long>(counts.dropped),
              static_cast<unsigned long long>(counts.statuses));
  std::printf("memory %.1f MB to %.1f MB, growth of the trend %.1f MB\n", memory.first_mb(), memory.last_mb(),
              memory.GrowthMb());
  if (counts.frames == 0 || faults.errors == 0) complaints.Add("nothing was tried");
  if (!testing::kSanitized && memory.GrowthMb() > kGrowthMb) complaints.Add("memory grows");
  std::printf("%s\n", complaints.count() == 0 ? "nothing wrong" : "WRONG");
  return complaints.count() == 0 ? 0 : 1;
}

}  // namespace
}  // namespace taclink::server

int main(int argc, char** argv) {
  taclink::server::Options options;
  CLI::App app("A server under random faults and clients", "taclink_soak");
  app.add_option("--seconds", options.seconds, "How long")->capture_default_str();
  app.add_option("--minutes", options.minutes, "Instead of seconds");
  app.add_option("--seed", options.seed, "Of all that is random")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(spdlog::level::off);
  gpr_set_log_function([](gpr_log_func_args*) {});
  try {
    return taclink::server::Run(options);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "taclink_soak: %s\n", e.what());
    return 1;
  }
}
