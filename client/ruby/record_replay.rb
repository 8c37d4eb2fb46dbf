#!/usr/bin/env ruby
# frozen_string_literal: true

# Records some seconds of what the arm feels on the server, lists the logs there, and plays the new one again.
$LOAD_PATH.unshift(File.join(__dir__, 'lib'))
require 'taclink/program'

# Ctrl-C ends it early, so that the recording is ended in any case.
def pause(seconds)
  puts "records for #{seconds} s"
  sleep(seconds)
rescue SignalException
  nil
end

def record(recording, name, seconds)
  recording.start_recording({ name: name, note: 'record_replay.rb' })
  pause(seconds)
  status = recording.stop_recording({}, timeout_s: Taclink::Patience.seconds(60)).status
  raise Taclink::Error, status.trouble unless status.trouble.empty?

  puts "recorded #{status.log}: #{status.frames} frames, #{status.frames_lost} lost, #{status.bytes} bytes"
  status.log
end

def list(recording)
  recording.list_logs.logs.each do |log|
    seconds = ((log.end_utc_ns - log.start_utc_ns) / 1e9).round(1)
    links = log.links.to_a.join(', ')
    puts "  #{log.name}: #{Taclink.utc_text(log.start_utc_ns)}, #{seconds} s, #{log.frames} frames of #{links}"
  end
end

# One line for each second of the log: frames and the largest force of each link.
class Seconds
  Link = Struct.new(:frames, :force)

  def initialize
    @second = 0
    @links = Hash.new { |links, name| links[name] = Link.new(0, 0.0) }
  end

  def add(second, frame)
    print(second) if second > @second
    link = @links[frame.link]
    link.frames += 1
    link.force = [link.force, *frame.contacts.map(&:normal_force_n)].max
  end

  def print(following)
    texts = @links.map { |name, link| format('%s %d frames, at most %.3f N', name, link.frames, link.force) }
    puts "  #{@second} s: #{texts.join('; ')}" unless texts.empty?
    @links.clear
    @second = following
  end
end

def replay(recording, log, speed)
  puts "plays #{log}"
  unwanted = { without_events: true, without_contacts: true, without_arm: true }
  request = { log: log, speed: speed, detail: :DETAIL_CONTACTS, **unwanted }
  seconds = Seconds.new
  status = nil
  frames = 0
  recording.replay(request, silence_s: Taclink::Patience.seconds(10)) do |reply|
    status = reply.status if reply.message == :status
    next unless reply.message == :frame

    frames += 1
    seconds.add((reply.log_utc_ns - status.from_utc_ns) / 1_000_000_000, reply.frame)
  end
  seconds.print(0)
  length = ((status.to_utc_ns - status.from_utc_ns) / 1e9).round(1)
  puts "played #{frames} frames in #{length} s of the log, #{status.damaged} places damaged"
end

program = Taclink::Program.new
program.number('seconds', 'how long to record, s', 5, 0.1..3600)
program.number('speed', 'how fast to play, 0.1 to 100; 0: as fast as it can be read', 2, 0..100)
program.text('name', "part of the log's name", 'example')
program.flag('delete', 'delete the log at the end')
program.run do |client, options|
  log = record(client.recording, options[:name], options[:seconds])
  list(client.recording)
  replay(client.recording, log, options[:speed])
  client.recording.delete_log({ log: log }) if options[:delete]
end
