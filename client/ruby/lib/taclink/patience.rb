# frozen_string_literal: true

module Taclink
  # How long is waited where nothing else is asked for.
  module Patience
    VARIABLE = 'TACLINK_PATIENCE_S'
    MOST_S = 86_400.0 # far below what gRPC can hold

    module_function

    # usual_s, or what the environment variable TACLINK_PATIENCE_S says where that is more. Not set and empty are the
    # same; more than a day counts as a day. Raises where it is no positive number.
    def seconds(usual_s)
      text = ENV.fetch(VARIABLE, '')
      return usual_s if text.empty?

      seconds = Float(text, exception: false)
      return [usual_s, [seconds, MOST_S].min].max if seconds&.finite? && seconds.positive?

      raise Error, "the environment variable #{VARIABLE} is '#{text}', but must be a positive number of seconds, " \
                   'such as 60'
    end
  end
end
