# frozen_string_literal: true

require 'taclink/client'

# The examples as programs.
class ExamplesTest < Minitest::Test
  def setup
    @server = Servers.standing
  end

  def with_client
    client = Taclink::Client.new(server: @server.address)
    yield client
  ensure
    client&.close
  end

  def assert_fails(words, name, *options)
    status, output, errors = run_example(@server.address, name, *options)
    assert_equal [1, ''], [status, output]
    assert_match words, errors
    assert_equal 1, errors.lines.size, errors
  end

  def test_contacts_prints_links_forces_in_newtons_and_places_in_metres
    force = wait_for('the touch') do
      status, output, errors = run_example(@server.address, 'contacts.rb', '--count', '2')
      assert_equal [0, ''], [status, errors]
      assert_match(/\Aarm test, server \d.*\n  sleeve: [a-z]+, /, output)
      assert_equal 2, output.scan(/ contacts, total (?:\(.*\) N|not known)$/).size, output
      found = output[/^  sleeve #\d+: (\S+) N, force \(.*\) N at \(.*\) m$/, 1].to_f
      found if found > 0.9 * TOUCH[:force_n]
    end
    assert_in_delta TOUCH[:force_n], force, 0.02
  end

  def test_record_replay_records_lists_plays_and_deletes
    options = %w[--seconds 1 --speed 0 --name short --delete]
    status, output, errors = run_example(@server.address, 'record_replay.rb', *options)
    assert_equal [0, ''], [status, errors]
    log, recorded = output.match(/^recorded (short-\S+\.mcap): (\d+) frames, 0 lost/).captures
    assert_includes output, "\n  #{log}: "
    assert_equal recorded, output[/^played (\d+) frames in .* 0 places damaged$/, 1]
    with_client { |client| refute_includes client.recording.list_logs.logs.map(&:name), log }
  end

  def test_a_signal_ends_the_recording_early
    ending = ->(line, pid) { Process.kill('TERM', pid) if line.start_with?('records for') }
    options = %w[--seconds 3600 --speed 0 --delete]
    status, output, errors = run_example(@server.address, 'record_replay.rb', *options, &ending)
    assert_equal [0, ''], [status, errors]
    assert_match(/^recorded example-/, output)
  end

  def test_a_recording_that_is_under_way_is_not_disturbed
    with_client do |client|
      client.recording.start_recording({ name: 'first' })
      assert_fails(/\Aerror: first-\S+ is being recorded.*FAILED_PRECONDITION/, 'record_replay.rb')
      assert_equal :RECORDER_STATE_IDLE, client.recording.stop_recording.status.state
    end
  end

  def test_a_server_that_ends_is_told
    mortal = Server.new.start
    ending = ->(line, _) { Process.kill('TERM', mortal.pid) if line.include?(' total ') }
    status, _, errors = run_example(mortal.address, 'contacts.rb', &ending)
    assert_equal 1, status
    assert_match(/\Aerror: .*\(UNAVAILABLE\)\n\z/, errors)
  ensure
    mortal&.stop
  end

  def test_failures_are_one_line_and_status_1
    nobody = "unix:#{@server.path('no-such-socket')}"
    %w[contacts.rb record_replay.rb].each { |name| assert_fails(/\Aerror: no server answers/, name, '--server', nobody) }
    assert_fails(/\Aerror: .*--rate/, 'contacts.rb', '--rate', 'often')
    assert_fails(/\Aerror: --rate must be/, 'contacts.rb', '--rate', '0')
    assert_fails(/\Aerror: .*--colour/, 'contacts.rb', '--colour')
  end
end
