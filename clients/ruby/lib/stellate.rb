# frozen_string_literal: true

$LOAD_PATH.unshift(File.join(__dir__, 'stellate', 'proto'))
require 'stellate/v1/stellate_services_pb'
require 'stellate/rpc/status_details_pb'
require 'stellate/shared'
$LOAD_PATH.shift

require_relative 'stellate/errors'
require_relative 'stellate/wire'
require_relative 'stellate/growth'
require_relative 'stellate/mesh'
require_relative 'stellate/oracle'
require_relative 'stellate/outage'
require_relative 'stellate/server'
require_relative 'stellate/client'
require_relative 'stellate/worker'
require_relative 'stellate/checkpoint'
require_relative 'stellate/session'
require_relative 'stellate/cloud'
require_relative 'stellate/reconstruct'
require_relative 'stellate/check'
require_relative 'stellate/epsilon'
require_relative 'stellate/manifolds'
require_relative 'stellate/progress_bar'
