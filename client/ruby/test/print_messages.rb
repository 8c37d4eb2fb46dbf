# frozen_string_literal: true

# print_messages.rb ADDRESS EVENTS: a frame and events as this client has them, one JSON object a line.
require 'json'
$LOAD_PATH.unshift File.expand_path('../lib', __dir__)
require 'taclink/client'

def plain(value)
  case value
  when Google::Protobuf::MessageExts then value.class.descriptor.to_h { |field| [field.name, plain(field.get(value))] }
  when Google::Protobuf::RepeatedField then value.map { |one| plain(one) }
  when Google::Protobuf::Map then value.to_h { |key, one| [key, plain(one)] }
  else value
  end
end

client = Taclink::Client.new(server: ARGV[0])
client.tactile.stream_frames({ detail: :DETAIL_FULL }) do |response|
  next unless response.frame

  puts JSON.generate(plain(response.frame))
  break
end
left = ARGV[1].to_i
client.tactile.stream_events({}) do |response|
  next unless response.event

  puts JSON.generate(plain(response.event))
  break if (left -= 1).zero?
end
