# frozen_string_literal: true

require 'taclink/client'

# The client against a server without TLS.
class ClientTest < Minitest::Test
  def setup
    @server = Servers.standing
    @client = Taclink::Client.new(server: @server.address)
  end

  def teardown
    @client&.close
  end

  def touched
    @client.tactile.stream_contacts({}, silence_s: PATIENCE_S) do |message|
      return message if message.contacts.any? { |contact| contact.normal_force_n > 0.9 * TOUCH[:force_n] }
    end
  end

  def test_a_touch_comes_with_its_force_and_its_place_in_the_base_frame
    contact = touched.contacts.first
    assert_equal 'sleeve', contact.link
    assert_in_delta TOUCH[:force_n], contact.normal_force_n, 0.02
    assert_in_delta TOUCH[:angle_rad], Math.atan2(contact.center_m.y, contact.center_m.x), 0.1
    assert_in_delta TOUCH[:z_m], contact.center_m.z, 0.005
  end

  def test_the_arm_is_told_in_full
    link = @client.tactile.get_arm.arm.links.first
    assert_equal :SOURCE_KIND_SIMULATED, link.source.kind
    assert_equal 3 * 24 * 10, link.model.markers.rest_positions_m.size
    assert_in_delta 0.1, link.base_from_link.translation_m.z
    assert_equal :ROLE_OPERATOR, @client.caller.role
  end

  def test_a_block_that_is_left_ends_its_call_on_the_server
    # Many more than the server allows at a time. It may hear of a call's end only after the next call has begun.
    give_up = Process.clock_gettime(Process::CLOCK_MONOTONIC) + 60
    100.times do
      @client.tactile.stream_frames do |reply|
        assert_equal :status, reply.message
        break
      end
    rescue GRPC::ResourceExhausted
      raise if Process.clock_gettime(Process::CLOCK_MONOTONIC) > give_up

      sleep 0.01
      retry
    end
    messages = @client.tactile.stream_contacts.take(2)
    assert_equal [1, 2], messages.map(&:sequence)
  end

  def test_what_the_server_refuses_is_an_error_with_its_words
    assert_match(/elbow/, assert_raises(GRPC::NotFound) { @client.operations.restart_link({ link: 'elbow' }) }.details)
    assert_raises(GRPC::NotFound) { @client.tactile.stream_frames({ links: ['elbow'] }).first }
    states = [{ names: ['shoulder'], positions: [0] }]
    error = assert_raises(GRPC::FailedPrecondition) { @client.tactile.update_joint_states(states) }
    assert_match(/URDF.*\(FAILED_PRECONDITION\)/, Taclink.describe(error))
  end

  def test_silence_ends_a_stream
    error = assert_raises(Taclink::Error) do
      @client.tactile.stream_contacts({}, silence_s: 0.5) { Process.kill('STOP', @server.pid) }
    end
    assert_match(/nothing from the server for 0.5 s/, error.message)
    assert_raises(Taclink::Error) { @client.tactile.stream_contacts({}, silence_s: 0.1).first }
  ensure
    Process.kill('CONT', @server.pid)
  end

  def test_times_are_exact
    assert_equal '2026-11-23T02:58:19.321Z', Taclink.utc_text(1_795_402_699_321_190_209)
  end
end

# Joint states of an arm that moves.
class JointStatesTest < Minitest::Test
  COUNT = 200

  def setup
    urdf = File.expand_path('../../../deploy/config/arm.urdf', __dir__)
    arm = STANDING_ARM.sub("arm:\n", "arm:\n  urdf: #{urdf}\n").sub('{position', '{frame: forearm, position')
    @server = Server.new.start(arm: arm)
    @client = Taclink::Client.new(server: @server.address)
  end

  def teardown
    @client&.close
    @server&.stop
  end

  def test_joint_states_are_taken_as_they_come
    names = @client.tactile.get_arm.arm.joints.map(&:name)
    start_ns = Process.clock_gettime(Process::CLOCK_REALTIME, :nanosecond) - 300_000_000
    states = (0...COUNT).lazy.map do |i|
      { names: names, positions: names.map { 0.001 * i }, utc_ns: start_ns + i * 1_000_000 }
    end
    done = @client.tactile.update_joint_states(states)
    assert_equal [COUNT, 0, ''], [done.accepted, done.refused, done.first_refusal]
  end

  def test_a_wrong_one_ends_the_call
    wrong = [{ names: ['no such joint'], positions: [0], utc_ns: 1 }].cycle
    error = assert_raises(GRPC::InvalidArgument) { @client.tactile.update_joint_states(wrong) }
    assert_match(/no such joint/, error.details)
  end
end
