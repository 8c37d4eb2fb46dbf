# frozen_string_literal: true

require 'digest'
require 'fileutils'
require 'open3'
require 'openssl'
require 'rbconfig'
require 'tmpdir'

RUBY_FOLDER = File.expand_path('..', __dir__)
TACLINKD = ENV.fetch('TACLINKD', File.expand_path('../../../build/dev/bin/taclinkd', __dir__))
# Long enough for a slow machine; what is waited for usually comes in a moment.
PATIENCE_S = 300

# The simulated touch once it has begun; base frame, of path 7 of 24 and ring 5, both from 1.
TOUCH = { force_n: 0.2, angle_rad: Math::PI / 2, z_m: 0.19 }.freeze

SCENE = <<~YAML
  taclink_scene: 1
  name: held
  model: cylinder
  frame_rate_hz: 10
  duration_s: 36000
  contacts:
    - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 2, end_s: 35999, ramp_s: 0.5}
YAML

STANDING_ARM = <<~YAML
  arm:
    name: test
    links:
      - {name: sleeve, model: cylinder, source: simulated, scene: held.yaml, pose: {position_mm: [0, 0, 100]}}
YAML

def now_s
  Process.clock_gettime(Process::CLOCK_MONOTONIC)
end

# Polls until the block gives something, and gives that back.
def wait_for(what)
  deadline = now_s + PATIENCE_S
  loop do
    found = yield
    return found if found
    raise "in vain waited for #{what}" if now_s > deadline

    sleep 0.05
  end
end

# A self-signed certificate for 127.0.0.1 and its key, both PEM.
def certificate_and_key
  key = OpenSSL::PKey::EC.generate('prime256v1')
  certificate = OpenSSL::X509::Certificate.new
  certificate.version = 2
  certificate.serial = 1
  certificate.subject = certificate.issuer = OpenSSL::X509::Name.parse('/CN=test')
  certificate.public_key = key
  certificate.not_before = Time.now - 3600
  certificate.not_after = Time.now + 86_400
  extensions = OpenSSL::X509::ExtensionFactory.new(certificate, certificate)
  certificate.add_extension(extensions.create_extension('subjectAltName', 'IP:127.0.0.1'))
  certificate.add_extension(extensions.create_extension('basicConstraints', 'CA:TRUE', true))
  certificate.sign(key, OpenSSL::Digest.new('SHA256'))
  [certificate.to_pem, key.to_pem]
end

# A real taclinkd with a simulated arm, at a free port, with a folder of its own.
class Server
  attr_reader :address, :pid

  def initialize
    @folder = Dir.mktmpdir('taclink-ruby-')
  end

  # Of a file in the server's folder.
  def path(name)
    File.join(@folder, name)
  end

  def start(arm: STANDING_ARM, security: '')
    File.write(path('held.yaml'), SCENE)
    File.write(path('arm.yaml'), "taclink_config: 1\nlimits: {max_frame_age_s: 3600}\n#{security}#{arm}")
    @pid = Process.spawn({ 'XDG_STATE_HOME' => path('state') }, TACLINKD, '--config', 'arm.yaml',
                         '--listen', '127.0.0.1:0', '--http-listen', '127.0.0.1:0',
                         chdir: @folder, %i[out err] => path('output'))
    @address = wait_for('the server') do
      raise "#{TACLINKD} did not start:\n#{output}" if ended?

      output[/listening on (\S+)\n/, 1]
    end
    self
  end

  # As start, with TLS and a token for operators; more: of the configuration's security.
  def start_secured(token, more = '')
    %w[ca.pem key.pem].zip(certificate_and_key) { |name, pem| File.write(path(name), pem, perm: 0o600) }
    File.write(path('tokens'), "tester operator #{Digest::SHA256.hexdigest(token)}\n", perm: 0o600)
    start(security: "security: {certificate: ca.pem, key: key.pem, tokens: tokens#{more}}\n")
  end

  def stop
    unless @pid.nil? || ended?
      Process.kill('KILL', @pid)
      Process.wait(@pid)
    end
    FileUtils.rm_rf(@folder)
  end

  private

  def output
    File.read(path('output'))
  end

  def ended?
    @ended ||= !Process.wait(@pid, Process::WNOHANG).nil?
  end
end

# Those that most tests share; they end with the tests.
module Servers
  TOKEN = 'a-token-of-these-tests'

  module_function

  def standing
    @standing ||= Server.new.start
  end

  # With TLS, and a token for operators.
  def secured
    @secured ||= Server.new.start_secured(TOKEN)
  end

  def stop
    [@standing, @secured].compact.each(&:stop)
  end
end

# Of the test's programs: nothing that the one who runs it has set for other servers; slow machines stay slow.
def plain_environment(more)
  ENV.keys.grep(/\ATACLINK_(?!PATIENCE_S\z)/).to_h { |name| [name, nil] }.merge(more)
end

# Runs a program to its end; the block is called with each line that it writes, and its process id.
def run_example(server, name, *options)
  command = [RbConfig.ruby, name, *options]
  Open3.popen3(plain_environment('TACLINK_SERVER' => server), *command, chdir: RUBY_FOLDER) do |input, output, errors, process|
    input.close
    said = Thread.new { errors.read }
    written = output.each_line.map { |line| line.tap { yield line, process.pid if block_given? } }.join
    [process.value.exitstatus, written, said.value]
  end
end
