# frozen_string_literal: true

require 'grpc'

module Taclink
  # What is wrong on this side.
  class Error < StandardError; end
end

require 'taclink/calls'
require 'taclink/credentials'
require 'taclink/generated'
require 'taclink/patience'

module Taclink
  # A connection to a server. Fields are those of proto/taclink/v1, in SI units (m, N, Pa, s, rad); enums are symbols.
  class Client
    CONNECT_S = 3
    ATTEMPT_S = 20 # gRPC's own
    UNREACHABLE = [GRPC::Unavailable, GRPC::DeadlineExceeded].freeze

    # Services, and whom the server takes this client for.
    attr_reader :tactile, :recording, :operations, :pressure, :simulation, :caller

    # A token goes with every call, never in the clear to another machine. It waits 3 s for the server, and calls wait
    # 10 s, or what TACLINK_PATIENCE_S says where that is more.
    def initialize(server: '127.0.0.1:50051', **secrets)
      credentials = Credentials.new(**secrets)
      metadata = credentials.for_calls(server)
      # Robots are on the local network: no proxy. The last is, despite its name, how long one attempt to connect may
      # take.
      options = { 'grpc.enable_http_proxy' => 0, 'grpc.use_local_subchannel_pool' => 1,
                  'grpc.min_reconnect_backoff_ms' => (1000 * Patience.seconds(ATTEMPT_S)).round }
      @channel = GRPC::Core::Channel.new(server, options, credentials.for_channel)
      services = [V1::TactileService, V1::RecordingService, V1::OperationsService, V1::PressureService,
                  V1::SimulationService]
      @tactile, @recording, @operations, @pressure, @simulation = services.map do |service|
        Calls.new(service, server, @channel, metadata)
      end
      greet(server)
    end

    def close
      @channel.close
    end

    private

    def greet(server)
      @caller = @operations.get_caller({}, timeout_s: Patience.seconds(CONNECT_S))
    rescue GRPC::BadStatus => e
      close
      raise unless UNREACHABLE.include?(e.class)

      raise Error, "no server answers at #{server} (#{e.details}); start taclinkd there or choose another with --server; " \
                   'a server with TLS needs --tls-ca, one with client_ca also --tls-certificate and --tls-key'
    end
  end

  module_function

  # One line for people: what the server said, or what is wrong here.
  def describe(error)
    return error.message.lines.first.to_s.chomp unless error.is_a?(GRPC::BadStatus)

    code = GRPC::Core::StatusCodes.constants.find { |name| GRPC::Core::StatusCodes.const_get(name) == error.code }
    "#{error.details.lines.first.to_s.chomp} (#{code})"
  end

  # ns since 1970-01-01 UTC, as text.
  def utc_text(nanoseconds)
    Time.at(0, nanoseconds, :nsec).utc.strftime('%FT%T.%LZ')
  end
end
