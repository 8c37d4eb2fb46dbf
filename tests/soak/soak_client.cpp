#include "tests/soak/soak_client.h"

#include <cmath>
#include <cstdio>
#include <thread>

#include "tests/integration/raw_socket.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr uint64_t kMostShown = 20;
constexpr milliseconds kPoll{50};

enum class Manner { kFast, kSlow, kCancels, kNeverReads, kGarbage, kManners };

struct Visit {
  const std::string& address;
  std::mt19937_64& random;
  Complaints& complaints;
  ClientCounts& counts;

  v1::StreamFramesRequest Request(Manner manner) const {
    constexpr v1::Detail kDetails[] = {v1::DETAIL_CONTACTS, v1::DETAIL_GEOMETRY, v1::DETAIL_FULL};
    v1::StreamFramesRequest request;
    request.set_detail(kDetails[random() % 3]);
    request.set_delivery(random() % 3 == 0 ? v1::DELIVERY_LATEST : v1::DELIVERY_EVERY);
    if (manner == Manner::kSlow) request.set_detail(v1::DETAIL_FULL);
    if (random() % 4 == 0) request.add_links("link0");
    if (random() % 5 == 0) request.set_max_rate_hz(20);
    if (random() % 5 == 0) request.set_deadband_force_n(0.5);
    return request;
  }

  void Read(client::FrameReader& reader, const v1::StreamFramesRequest& request, Manner manner,
            steady_clock::time_point end) const {
    const bool all = request.max_rate_hz() <= 0 && request.deadband_force_n() <= 0;
    StreamCheck check(all && request.delivery() == v1::DELIVERY_EVERY, complaints);
    bool cancelled = false;
    while (true) {
      const auto frame = reader.Next(kPoll);
      check.Counts(reader.status(), counts);
      if (frame) {
        check.Frame(*frame);
        ++counts.frames;
      } else if (frame.error().code == ErrorCode::kEndOfData && cancelled) {
        return;
      } else if (frame.error().code != ErrorCode::kTimeout) {
        return complaints.Add("a stream ended: " + frame.error().message);
      }
      if (manner == Manner::kSlow) std::this_thread::sleep_for(milliseconds(random() % 100));
      if (steady_clock::now() < end) continue;
      if (manner != Manner::kCancels) return;
      reader.Cancel();
      cancelled = true;
    }
  }

  void Stream(Manner manner, steady_clock::time_point end) const {
    auto connection = client::Client::Connect(address, std::chrono::seconds(60));
    if (!connection) return complaints.Add("no connection: " + connection.error().message);
    const auto request = Request(manner);
    const auto reader = connection->StreamFrames(request, std::chrono::seconds(60));
    if (!reader && reader.error().code == ErrorCode::kResourceExhausted) {
      ++counts.refused;
      std::this_thread::sleep_for(kPoll);
      return;
    }
    if (!reader) return complaints.Add("no stream: " + reader.error().message);
    ++counts.streams;
    if (manner == Manner::kNeverReads) return std::this_thread::sleep_until(end);
    Read(**reader, request, manner, end);
  }

  void Garbage() const {
    const RawSocket socket(address);
    std::string bytes = random() % 2 == 0 ? Http2Preface() : "";
    for (size_t i = random() % 3000; i > 0; --i) bytes += static_cast<char>(random());
    socket.Send(bytes);
    std::this_thread::sleep_for(milliseconds(random() % 50));
  }
};

}  // namespace

void Complaints::Add(const std::string& what) {
  const std::lock_guard lock(mutex_);
  if (++count_ <= kMostShown) std::fprintf(stderr, "WRONG: %s\n", what.c_str());
}

// A status tells what was sent before it, and it comes in its place between the frames.
void StreamCheck::Counts(const v1::StreamStatus& status, ClientCounts& out) {
  for (const v1::LinkStreamCounts& told : status.links()) {
    PerLink& link = links_[told.link()];
    if (told.frames_dropped() == link.dropped_told) continue;
    out.dropped += told.frames_dropped() - link.dropped_told;
    ++out.statuses;
    link.dropped_told = told.frames_dropped();
    if (told.frames_sent() != link.received)
      complaints_.Add(told.link() + ": " + std::to_string(told.frames_sent()) + " sent, " +
                      std::to_string(link.received) + " received");
    if (every_ && link.lost > static_cast<int64_t>(told.frames_dropped()))
      complaints_.Add(told.link() + ": " + std::to_string(link.lost) + " lost, " +
                      std::to_string(told.frames_dropped()) + " told");
  }
}

void StreamCheck::Frame(const v1::LinkFrame& frame) {
  PerLink& link = links_[frame.link()];
  ++link.received;
  if (frame.times().exposure_ns() == 0) return;  // a status repeats the last sequence
  if (link.sequence != 0 && frame.sequence() <= link.sequence)
    complaints_.Add(frame.link() + ": sequence " + std::to_string(frame.sequence()) + " after " +
                    std::to_string(link.sequence));
  link.sequence = frame.sequence();
  if (!frame.has_pressure_pa()) return;  // the processor threw
  const auto order = std::llround(frame.pressure_pa());
  if (link.order != 0) link.lost += order - link.order - 1;
  link.order = order;
}

void RunSoakClient(const std::string& address, uint64_t seed, steady_clock::time_point end,
                   Complaints& complaints, ClientCounts& counts) {
  std::mt19937_64 random(seed);
  const Visit visit{address, random, complaints, counts};
  while (steady_clock::now() < end) {
    const auto manner = static_cast<Manner>(random() % static_cast<uint64_t>(Manner::kManners));
    const auto until = std::min(end, steady_clock::now() + milliseconds(random() % 2000));
    if (manner == Manner::kGarbage) {
      visit.Garbage();
    } else {
      visit.Stream(manner, until);
    }
  }
}

}  // namespace taclink::server
