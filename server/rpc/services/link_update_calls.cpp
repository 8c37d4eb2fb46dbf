#include "server/rpc/services/link_update_calls.h"

#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "server/arm/client_time.h"
#include "server/replay/replay_link.h"
#include "server/rpc/requests/request_check.h"
#include "taclink/v1/attitude.pb.h"
#include "taclink/v1/pressure.pb.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

/// What one client says of links, one message after the other, each at an instant.
template <typename Request, typename Response>
class LinkUpdateIntake {
 public:
  /// `tell`: false: not newer than what is known.
  using Tell = std::function<Result<bool>(size_t link, const Request& request, int64_t time_ns)>;
  LinkUpdateIntake(Arm& arm, Tell tell) : arm_(arm), tell_(std::move(tell)) {}

  Result<void> Take(const grpc::ByteBuffer& bytes) {
    if (arm_.plays_log()) return PlaysLog();
    const auto request = ParseRequest<Request>(bytes);
    return request ? Take(*request) : request.error();
  }
  Response Summary() const {
    Response response;
    response.set_accepted(accepted_);
    response.set_refused(refused_);
    return response;
  }

 private:
  Result<void> Take(const Request& request) {
    if (!request.link().empty()) {
      const auto link = arm_.FindLink(request.link());
      if (!link) return link.error();
      link_ = *link;
    }
    if (!link_) return Error{ErrorCode::kInvalidArgument, "the first message must name the link"};
    int64_t time_ns = arm_.clock().MonotonicNs();
    if (request.time_case() != Request::TIME_NOT_SET) {
      const auto given_ns = MonotonicOf(request.utc_ns(), request.monotonic_ns(), arm_.clock());
      if (!given_ns) return given_ns.error();
      time_ns = *given_ns;
    }
    const auto taken = tell_(*link_, request, time_ns);
    if (!taken)
      return Error{taken.error().code, "link '" + arm_.links()[*link_].name + "': " + taken.error().message};
    ++(*taken ? accepted_ : refused_);
    return {};
  }

  Arm& arm_;
  const Tell tell_;
  std::optional<size_t> link_;
  uint64_t accepted_ = 0, refused_ = 0;
};

template <typename Request, typename Response>
grpc::ServerReadReactor<grpc::ByteBuffer>* Begin(std::shared_ptr<LinkUpdateIntake<Request, Response>> intake,
                                                 UpdateRegistry& registry, const Party& party,
                                                 grpc::ByteBuffer& response) {
  auto stream = std::make_shared<UpdateStream>(
      registry, [intake](const grpc::ByteBuffer& bytes) { return intake->Take(bytes); },
      [intake] { return ToBytes(intake->Summary()); }, response);
  stream->Begin(registry.Add(stream, party));
  return stream.get();  // the registry, or if refused itself, holds it until gRPC is done
}

}  // namespace

grpc::ServerReadReactor<grpc::ByteBuffer>* TakePressure(Arm& arm, UpdateRegistry& registry,
                                                        const Party& party, grpc::ByteBuffer& response) {
  const auto tell = [&arm](size_t link, const v1::UpdatePressureRequest& request, int64_t time_ns) {
    return arm.pressure(link).Tell(request.pressure_pa() / wire::kPascalsPerMpa, time_ns);
  };
  return Begin(
      std::make_shared<LinkUpdateIntake<v1::UpdatePressureRequest, v1::UpdatePressureResponse>>(arm, tell),
      registry, party, response);
}

grpc::ServerReadReactor<grpc::ByteBuffer>* TakeAttitude(Arm& arm, UpdateRegistry& registry,
                                                        const Party& party, grpc::ByteBuffer& response) {
  const auto tell = [&arm](size_t link, const v1::UpdateAttitudeRequest& request,
                           int64_t time_ns) -> Result<bool> {
    if (!request.has_specific_force_mps2())
      return Error{ErrorCode::kInvalidArgument, "specific_force_mps2 is missing"};
    const v1::Vector3& given = request.specific_force_mps2();
    return arm.attitude(link).Tell({given.x(), given.y(), given.z()}, request.sigma_mps2(), time_ns);
  };
  return Begin(
      std::make_shared<LinkUpdateIntake<v1::UpdateAttitudeRequest, v1::UpdateAttitudeResponse>>(arm, tell),
      registry, party, response);
}

}  // namespace taclink::server
