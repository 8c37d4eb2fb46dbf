#!/usr/bin/env ruby
# frozen_string_literal: true

# Lists the links, then prints all contacts of the arm: places in m, forces in N, both in the arm's base frame.
$LOAD_PATH.unshift(File.join(__dir__, 'lib'))
require 'taclink/program'

def vector(value, digits)
  components = [value&.x, value&.y, value&.z].map { |component| format("%#{digits + 3}.#{digits}f", component || 0) }
  "(#{components.join(', ')})"
end

def print_links(arm)
  puts "arm #{arm.name}, server #{arm.server_version}"
  arm.links.each do |link|
    status = link.status.to_s.delete_prefix('LINK_STATUS_').downcase
    puts format('  %<name>s: %<status>s, %<rate>.1f frames/s, latency %<latency>.4f s  %<reason>s',
                name: link.name, status: status, rate: link.statistics.rate_hz,
                latency: link.statistics.latency_p50_s, reason: link.status_reason).rstrip
  end
end

def print_contacts(message)
  total = message.total ? "#{vector(message.total.force_n, 3)} N" : 'not known'
  puts "#{Taclink.utc_text(message.utc_ns)}  #{message.contacts.size} contacts, total #{total}"
  message.contacts.each do |contact|
    puts format('  %<link>s #%<id>d: %<push>.3f N, force %<force>s N at %<place>s m',
                link: contact.link, id: contact.link_contact_id, push: contact.normal_force_n,
                force: vector(contact.wrench.force_n, 3), place: vector(contact.center_m, 4))
  end
end

program = Taclink::Program.new
program.number('count', 'end after so many messages; 0: never', 0, 0..1e9)
program.number('rate', 'at most so many messages a second, Hz', 10, 0.001..1000)
program.run do |client, options|
  print_links(client.tactile.get_arm.arm)
  rate = options[:rate].to_f
  # The server says something at least once a second, but never more often than asked for.
  silence_s = Taclink::Patience.seconds(5) + 3 / rate
  client.tactile.stream_contacts({ max_rate_hz: rate }, silence_s: silence_s).with_index(1) do |message, taken|
    print_contacts(message)
    break if options[:count].positive? && taken >= options[:count]
  end
end
