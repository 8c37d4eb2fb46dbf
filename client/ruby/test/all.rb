# frozen_string_literal: true

# Runs every test: ruby test/all.rb
require 'tmpdir'

# Generated code is made again, and does not stay.
CACHE = Dir.mktmpdir('taclink-ruby-cache-')
ENV['XDG_CACHE_HOME'] = CACHE
# gRPC would write what the tests expect to fail.
ENV['GRPC_VERBOSITY'] ||= 'NONE'
$LOAD_PATH.unshift(File.expand_path('../lib', __dir__), __dir__)

require 'minitest/autorun'
require 'server'

Minitest.after_run do
  Servers.stop
  FileUtils.rm_rf(CACHE)
end
Dir[File.join(__dir__, '*_test.rb')].sort.each { |file| require file }
