# frozen_string_literal: true

require 'optparse'
require 'taclink/client'

module Taclink
  # Runs an example: its options, its connection, one line and status 1 where something fails.
  class Program
    def initialize
      @values = { server: ENV.fetch('TACLINK_SERVER', '127.0.0.1:50051'), tls_ca: ENV.fetch('TACLINK_TLS_CA', nil),
                  tls_certificate: ENV.fetch('TACLINK_TLS_CERTIFICATE', nil), tls_key: ENV.fetch('TACLINK_TLS_KEY', nil) }
      @parser = OptionParser.new
    end

    def number(name, what, preset, range)
      key = name.tr('-', '_').to_sym
      @values[key] = preset
      @parser.on("--#{name} X", Float, "#{what} (#{preset})") do |value|
        raise Error, "--#{name} must be a number from #{range.begin} to #{range.end}" unless range.cover?(value)

        @values[key] = value
      end
    end

    def text(name, what, preset)
      @values[name.to_sym] = preset
      @parser.on("--#{name} TEXT", "#{what} (#{preset})") { |value| @values[name.to_sym] = value }
    end

    def flag(name, what)
      @parser.on("--#{name}", what) { @values[name.to_sym] = true }
    end

    def run
      $stdout.sync = true
      read_options
      client = Client.new(token: ENV.fetch('TACLINK_TOKEN', nil), **@values.slice(:server, :tls_ca, :tls_certificate, :tls_key))
      yield client, @values
    rescue Interrupt
      exit 130
    rescue Errno::EPIPE
      nil # `| head`
    rescue Error, OptionParser::ParseError, GRPC::BadStatus => e
      abort "error: #{Taclink.describe(e)}"
    ensure
      client&.close
    end

    private

    def read_options
      @parser.on('--server HOST:PORT', 'address of the server') { |value| @values[:server] = value }
      @parser.on('--tls-ca FILE', "certificates that the server's must be signed by: TLS") { |value| @values[:tls_ca] = value }
      @parser.on('--tls-certificate FILE', "this client's own certificate") { |value| @values[:tls_certificate] = value }
      @parser.on('--tls-key FILE', "the key of this client's certificate") { |value| @values[:tls_key] = value }
      @parser.separator "The server's token is in the environment variable TACLINK_TOKEN."
      @parser.separator 'TACLINK_PATIENCE_S: seconds to wait for a slow server, where that is more than usual.'
      rest = @parser.parse(ARGV)
      raise Error, "unknown argument #{rest.first}" unless rest.empty?
    end
  end
end
