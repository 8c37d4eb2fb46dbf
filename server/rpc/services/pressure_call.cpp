#include "server/rpc/services/pressure_call.h"

#include <memory>
#include <optional>

#include "server/arm/client_time.h"
#include "server/replay/replay_link.h"
#include "server/rpc/requests/request_check.h"
#include "taclink/v1/pressure.pb.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

/// What one client says of the pressures.
class PressureIntake {
 public:
  explicit PressureIntake(Arm& arm) : arm_(arm) {}

  Result<void> Take(const grpc::ByteBuffer& bytes) {
    if (arm_.plays_log()) return PlaysLog();
    const auto request = ParseRequest<v1::UpdatePressureRequest>(bytes);
    return request ? Take(*request) : request.error();
  }
  v1::UpdatePressureResponse Response() const {
    v1::UpdatePressureResponse response;
    response.set_accepted(accepted_);
    response.set_refused(refused_);
    return response;
  }

 private:
  Result<void> Take(const v1::UpdatePressureRequest& request) {
    if (!request.link().empty()) {
      const auto link = arm_.FindLink(request.link());
      if (!link) return link.error();
      link_ = *link;
    }
    if (!link_) return Error{ErrorCode::kInvalidArgument, "the first message must name the link"};
    int64_t time_ns = arm_.clock().MonotonicNs();
    if (request.time_case() != v1::UpdatePressureRequest::TIME_NOT_SET) {
      const auto given_ns = MonotonicOf(request.utc_ns(), request.monotonic_ns(), arm_.clock());
      if (!given_ns) return given_ns.error();
      time_ns = *given_ns;
    }
    const auto taken = arm_.pressure(*link_).Tell(request.pressure_pa() / wire::kPascalsPerMpa, time_ns);
    if (!taken)
      return Error{taken.error().code, "link '" + arm_.links()[*link_].name + "': " + taken.error().message};
    ++(*taken ? accepted_ : refused_);
    return {};
  }

  Arm& arm_;
  std::optional<size_t> link_;
  uint64_t accepted_ = 0, refused_ = 0;
};

}  // namespace

grpc::ServerReadReactor<grpc::ByteBuffer>* TakePressure(Arm& arm, UpdateRegistry& registry,
                                                        const Party& party, grpc::ByteBuffer& response) {
  auto intake = std::make_shared<PressureIntake>(arm);
  auto stream = std::make_shared<UpdateStream>(
      registry, [intake](const grpc::ByteBuffer& bytes) { return intake->Take(bytes); },
      [intake] { return ToBytes(intake->Response()); }, response);
  stream->Begin(registry.Add(stream, party));
  return stream.get();  // the registry, or if refused itself, holds it until gRPC is done
}

}  // namespace taclink::server
