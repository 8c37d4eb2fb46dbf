# frozen_string_literal: true

require 'taclink/client'

# The client against a server with TLS and tokens.
class SecurityTest < Minitest::Test
  TOKEN = Servers::TOKEN

  def setup
    @server = Servers.secured
  end

  def connect(**more)
    Taclink::Client.new(server: @server.address, tls_ca: @server.path('ca.pem'), token: TOKEN, **more)
  end

  def assert_refused(words, **options)
    assert_match(words, assert_raises(Taclink::Error) { connect(**options) }.message)
  end

  def test_with_tls_and_a_token_the_server_knows_the_caller_also_in_streams
    client = connect
    assert_equal ['tester', :ROLE_OPERATOR], [client.caller.name, client.caller.role]
    assert_equal 1, client.tactile.stream_contacts.first.links.size
    client.close
  end

  def test_without_its_token_nobody_gets_in
    ['', 'another'].each do |token|
      client = connect(token: token)
      assert_equal :ROLE_NOBODY, client.caller.role
      assert_raises(GRPC::Unauthenticated) { client.tactile.get_arm }
      client.close
    end
  end

  def test_a_server_without_a_trusted_certificate_is_none
    other = @server.path('other.pem')
    File.write(other, certificate_and_key.first)
    assert_refused(/no server answers at/, tls_ca: other)
    assert_refused(/no server answers at/, tls_ca: nil)
  end

  def test_a_client_shows_its_own_certificate_to_a_server_that_asks_for_one
    asking = Server.new.start_secured(TOKEN, ', client_ca: ca.pem')
    known = { server: asking.address, tls_ca: asking.path('ca.pem') }
    assert_refused(/no server answers at/, **known)
    client = connect(**known, tls_certificate: asking.path('ca.pem'), tls_key: asking.path('key.pem'))
    assert_equal :ROLE_OPERATOR, client.caller.role
    client.close
  ensure
    asking&.stop
  end

  def test_a_token_does_not_go_to_another_machine_in_the_clear
    ['robot:50051', '127.robot.example:50051', 'localhost.example:50051', '[::2]:50051'].each do |address|
      error = assert_raises(Taclink::Error) { Taclink::Client.new(server: address, token: TOKEN) }
      assert_match(/in the clear/, error.message)
    end
  end

  def test_credentials_that_cannot_be_used_so_are_refused_before_a_call
    assert_refused(/need each other/, tls_key: 'key.pem')
    assert_refused(/needs TLS/, tls_ca: nil, token: nil, tls_key: 'k', tls_certificate: 'c')
    assert_refused(/no-such-file cannot be read/, tls_ca: 'no-such-file')
  end
end
