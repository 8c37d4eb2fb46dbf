# frozen_string_literal: true

module Taclink
  # Ends a call from which nothing comes for some seconds.
  class SilenceWatch
    def initialize(call, silence_s)
      @call = call
      @silence_s = silence_s
      @silent = false
      listen
      @thread = Thread.new { watch }
    end

    attr_reader :silent

    def listen
      @deadline = now + @silence_s
    end

    # What the receiver of a message does takes as long as it likes.
    def pause
      @deadline = Float::INFINITY
    end

    def stop
      @thread.kill
    end

    private

    def now
      Process.clock_gettime(Process::CLOCK_MONOTONIC)
    end

    def watch
      until (left = @deadline - now) <= 0
        sleep([left, @silence_s].min)
      end
      @silent = true
      @call.cancel
    end
  end

  # The methods of a service, with a hash as the request: an answer, a stream of messages for a block (or an
  # enumerator), or an answer to an enumerable of hashes.
  class Calls
    CALL_S = 10

    def initialize(service, server, channel, metadata)
      @stub = service::Stub.new(server, nil, channel_override: channel)
      @metadata = metadata
      service::Service.rpc_descs.each do |name, method|
        ruby_name = GRPC::GenericService.underscore(name.to_s).to_sym
        if method.client_streamer? then define_client_stream(ruby_name, method.input.type)
        elsif method.server_streamer? then define_server_stream(ruby_name, method.input)
        else define_unary(ruby_name, method.input)
        end
      end
    end

    private

    def define_unary(name, type)
      define_singleton_method(name) do |request = {}, timeout_s: Patience.seconds(CALL_S)|
        @stub.public_send(name, type.new(**request), metadata: @metadata, deadline: Time.now + timeout_s)
      end
    end

    def define_client_stream(name, type)
      define_singleton_method(name) do |requests|
        @stub.public_send(name, requests.lazy.map { |request| type.new(**request) }, metadata: @metadata)
      end
    end

    # Leaving the block cancels the call. Raises after silence_s seconds without a message, if given.
    def define_server_stream(name, type)
      define_singleton_method(name) do |request = {}, silence_s: nil, &block|
        next enum_for(name, request, silence_s: silence_s) unless block

        call = @stub.public_send(name, type.new(**request), metadata: @metadata, return_op: true)
        receive(call, silence_s, &block)
      end
    end

    def receive(call, silence_s)
      watch = SilenceWatch.new(call, silence_s) if silence_s
      call.execute.each do |message|
        watch&.pause
        yield message
        watch&.listen
      end
    rescue GRPC::Cancelled, GRPC::Core::CallError # the latter where nothing came at all
      raise unless watch&.silent

      raise Error, "nothing from the server for #{silence_s} s; check server and network"
    ensure
      watch&.stop
      call.cancel
    end
  end
end
