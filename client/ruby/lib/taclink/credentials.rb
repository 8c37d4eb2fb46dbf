# frozen_string_literal: true

require 'grpc'

module Taclink
  # How a client knows the server and shows who it is itself. Files are PEM.
  class Credentials
    # Written out, so that no name that only looks like such an address is taken for this machine.
    THIS_MACHINE = /\A(unix:.*|(localhost|127\.\d{1,3}\.\d{1,3}\.\d{1,3}|\[::1\]):\d+)\z/.freeze

    def initialize(token: nil, tls_ca: nil, tls_certificate: nil, tls_key: nil)
      @token, @ca, @certificate, @key = [token, tls_ca, tls_certificate, tls_key].map { |text| text unless text.to_s.empty? }
    end

    # What a channel asks for. Raises where a file is missing or the options do not fit each other.
    def for_channel
      raise Error, "a client's certificate and its key need each other" if @certificate.nil? != @key.nil?
      return GRPC::Core::ChannelCredentials.new(read(@ca), read(@key), read(@certificate)) if @ca
      return :this_channel_is_insecure unless @key

      raise Error, "a client's certificate needs TLS: say with --tls-ca whom to trust as the server"
    end

    # What goes with every call. Raises where a token would go in the clear to another machine.
    def for_calls(server)
      return {} unless @token
      raise Error, "the token would go to #{server} in the clear; use TLS (--tls-ca)" unless @ca || THIS_MACHINE.match?(server)

      { 'authorization' => "Bearer #{@token}" }
    end

    private

    def read(path)
      path && File.binread(path)
    rescue SystemCallError => e
      raise Error, "#{path} cannot be read (#{e.class.name.split('::').last}); check the path"
    end
  end
end
