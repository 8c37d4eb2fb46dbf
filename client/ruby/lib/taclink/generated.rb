# frozen_string_literal: true

require 'digest'
require 'fileutils'
require 'tmpdir'

module Taclink
  # The code that protoc makes of proto/, made once for each state of these files and kept in the user's cache.
  module Generated
    PROTO = File.expand_path('../../../../proto', __dir__)
    FILES = Dir[File.join(PROTO, 'taclink/v1/*.proto')].sort.freeze

    module_function

    # Made anew with another version of Ruby too, which comes with other libraries.
    def folder
      digest = Digest::SHA256.new
      [RUBY_VERSION, *FILES.map { |file| File.read(file) }].each { |text| digest << text }
      cache = ENV.fetch('XDG_CACHE_HOME', '')
      cache = File.join(Dir.home, '.cache') if cache.empty?
      File.join(cache, 'taclink', "ruby-#{digest.hexdigest[0, 16]}")
    end

    def plugin
      paths = ENV.fetch('PATH', '').split(File::PATH_SEPARATOR).map { |path| File.join(path, 'grpc_ruby_plugin') }
      paths.find { |path| File.executable?(path) } or
        raise 'grpc_ruby_plugin is missing: apt-get install protobuf-compiler protobuf-compiler-grpc'
    end

    def generate(folder)
      FileUtils.mkdir_p(folder)
      command = ['protoc', "-I#{PROTO}", "--ruby_out=#{folder}", "--grpc_out=#{folder}",
                 "--plugin=protoc-gen-grpc=#{plugin}", *FILES]
      system(*command) or raise 'protoc failed: apt-get install protobuf-compiler protobuf-compiler-grpc'
    end

    # Appears whole, also when several programs begin at the same time.
    def make(folder)
      cache = File.dirname(folder)
      FileUtils.mkdir_p(cache)
      Dir.mktmpdir('making-', cache) do |temporary|
        generate(File.join(temporary, 'code'))
        File.rename(File.join(temporary, 'code'), folder)
      end
    rescue Errno::EEXIST, Errno::ENOTEMPTY
      nil # another one was faster
    end

    def load
      made = folder
      make(made) unless File.directory?(made)
      $LOAD_PATH.unshift(made) unless $LOAD_PATH.include?(made)
      %w[tactile recording operations pressure simulation].each { |name| require "taclink/v1/#{name}_services_pb" }
    end
  end
end

Taclink::Generated.load
