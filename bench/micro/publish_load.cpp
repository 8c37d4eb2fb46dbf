// What one nats-server with JetStream takes of many links: frames (GEOMETRY) at 10 a second and contacts at
// 5, as servers of 20 links each would send them. Prints a row of Markdown for each number of links.
//   taclink_publish_load SECONDS LINKS...
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "server/hub/encoder.h"
#include "server/publish/nats_connection.h"
#include "tests/server/publish/nats_server.h"
#include "tests/server/test_state.h"

namespace taclink::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kLinksPerServer = 20;
constexpr int kTicksPerSecond = 100;
constexpr int kFrameEvery = 10, kContactsEvery = 20;  // ticks
constexpr size_t kRoomBytes = size_t{64} << 20;

double CpuSeconds(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/stat");
  std::string text{std::istreambuf_iterator<char>(in), {}};
  text.erase(0, text.rfind(')') + 2);
  long user = 0, system = 0;
  std::sscanf(text.c_str(), "%*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %ld %ld", &user, &system);
  return static_cast<double>(user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// A server that sends the frames of its links.
class Sender {
 public:
  Sender(const std::string& url, int number, int links)
      : number_(number), links_(links), outbox_(kRoomBytes) {
    PublishConfig config{.url = url, .site = "bench", .stream = "BENCH", .stream_mb = 20'000};
    connection_ = std::move(*NatsConnection::Open(
        config, "load",
        {.changed = [] {},
         .answered = [this](const std::string& id, const std::string& error) { Answered(id, error); }}));
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!connection_->connected()) {
      if (std::chrono::steady_clock::now() > limit)
        std::fprintf(stderr, "no NATS server at %s within 10 s\n", url.c_str()), std::exit(1);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    if (const auto good = connection_->PrepareStream(); !good)
      std::fprintf(stderr, "%s\n", good.error().message.c_str()), std::exit(1);
  }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;
  ~Sender() { connection_.reset(); }

  void Tick(int64_t tick, const std::array<std::shared_ptr<const std::string>, kDetailCount>& bytes) {
    const std::lock_guard lock(mutex_);
    for (int link = 0; link < links_; ++link) {
      if ((tick + link) % kFrameEvery == 0) Push(link, "frame", tick, bytes[Index(Detail::kGeometry)], true);
      if ((tick + link) % kContactsEvery == 0)
        Push(link, "contacts", tick, bytes[Index(Detail::kContacts)], false);
    }
    while (const OutMessage* message = outbox_.Next()) {
      sent_at_[message->id] = Clock::now();
      bytes_ += message->size();
      if (!connection_->Send(*message)) ++failed_;
    }
  }
  OutboxCounts counts() {
    const std::lock_guard lock(mutex_);
    return outbox_.counts();
  }
  uint64_t bytes() const { return bytes_; }
  uint64_t failed() const { return failed_; }
  void TakeDelays(std::vector<double>& all) {
    const std::lock_guard lock(mutex_);
    all.insert(all.end(), delays_ms_.begin(), delays_ms_.end());
  }

 private:
  void Push(int link, const char* kind, int64_t tick, std::shared_ptr<const std::string> bytes, bool frame) {
    const std::string subject =
        "taclink.bench.arm" + std::to_string(number_) + ".link" + std::to_string(link) + "." + kind;
    outbox_.Push({.subject = subject,
                  .id = subject + "." + std::to_string(tick),
                  .bytes = std::move(bytes),
                  .frame = frame});
  }
  void Answered(const std::string& id, const std::string& error) {
    const std::lock_guard lock(mutex_);
    if (!error.empty()) ++failed_;
    outbox_.Acknowledge(id);
    const auto sent = sent_at_.find(id);
    if (sent == sent_at_.end()) return;
    delays_ms_.push_back(std::chrono::duration<double, std::milli>(Clock::now() - sent->second).count());
    sent_at_.erase(sent);
  }

  const int number_, links_;
  std::unique_ptr<NatsConnection> connection_;
  std::mutex mutex_;
  Outbox outbox_;
  std::unordered_map<std::string, Clock::time_point> sent_at_;
  std::vector<double> delays_ms_;
  uint64_t bytes_ = 0;
  std::atomic<uint64_t> failed_ = 0;
};

void Measure(int links, int seconds,
             const std::array<std::shared_ptr<const std::string>, kDetailCount>& bytes) {
  testing::NatsServer nats;
  std::vector<std::unique_ptr<Sender>> senders;
  for (int left = links; left > 0; left -= kLinksPerServer)
    senders.push_back(std::make_unique<Sender>(nats.url(), static_cast<int>(senders.size()),
                                               std::min(left, kLinksPerServer)));
  const double cpu = CpuSeconds(nats.pid());
  const auto begin = Clock::now();
  const int64_t ticks = int64_t{seconds} * kTicksPerSecond;
  for (int64_t tick = 0; tick < ticks; ++tick) {
    std::this_thread::sleep_until(begin + tick * std::chrono::milliseconds(1000 / kTicksPerSecond));
    for (const auto& sender : senders) sender->Tick(tick, bytes);
  }
  const double elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
  uint64_t acknowledged = 0, in_flight = 0, sent_bytes = 0, failed = 0;
  std::vector<double> delays;
  for (const auto& sender : senders) {
    const OutboxCounts counts = sender->counts();
    acknowledged += counts.acknowledged;
    in_flight += counts.in_flight;
    sent_bytes += sender->bytes();
    failed += sender->failed();
    sender->TakeDelays(delays);
  }
  const double cores = (CpuSeconds(nats.pid()) - cpu) / elapsed;
  std::sort(delays.begin(), delays.end());
  const auto quantile = [&](double q) {
    return delays.empty() ? 0 : delays[static_cast<size_t>(q * static_cast<double>(delays.size() - 1))];
  };
  std::printf("| %d | %.0f | %.0f | %.1f | %llu | %llu | %.1f | %.1f | %.2f |\n", links, 15.0 * links,
              static_cast<double>(acknowledged) / elapsed, 1e-6 * static_cast<double>(sent_bytes) / elapsed,
              static_cast<unsigned long long>(in_flight), static_cast<unsigned long long>(failed),
              quantile(0.5), quantile(0.99), cores);
  std::fflush(stdout);
}

}  // namespace
}  // namespace taclink::server

int main(int argc, char** argv) {
  using namespace taclink;
  if (argc < 3) return std::fprintf(stderr, "taclink_publish_load SECONDS LINKS...\n"), 2;
  const server::FrameEncoder encode = server::MakeEncoder({"link"});
  LinkState state;
  server::FillTestState(0, 5, state);
  std::array<std::shared_ptr<const std::string>, kDetailCount> bytes;
  for (const Detail detail : kAllDetails)
    bytes[Index(detail)] = std::make_shared<const std::string>(encode(0, state, detail));
  std::printf("A frame: %zu bytes; contacts: %zu bytes.\n\n", bytes[Index(Detail::kGeometry)]->size(),
              bytes[Index(Detail::kContacts)]->size());
  std::printf(
      "| links | wanted/s | stored/s | MB/s | in flight at the end | failed | p50, ms | p99, ms | "
      "nats-server, cores |\n"
      "|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n");
  for (int i = 2; i < argc; ++i) server::Measure(std::atoi(argv[i]), std::atoi(argv[1]), bytes);
}
