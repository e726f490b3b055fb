# frozen_string_literal: true

require 'grpc'

# Meshes of smooth manifolds of any dimension, known through oracles alone.
module Stellate
  # Base of all errors of this library. What an oracle raises is none: it reaches the caller as itself.
  class StellateError < StandardError
    # `reason`: stable name, e.g. "ORACLE_NOT_FINITE"; `fields`: what is wrong with which field of a
    # request; `details`: what else is known; `mesh`: the unfinished mesh, where there is one.
    attr_reader :reason, :fields, :details
    attr_accessor :mesh

    def initialize(message, reason: 'UNSPECIFIED', fields: {}, details: {}, mesh: nil)
      super(message)
      @reason, @fields, @details, @mesh = reason, fields, details, mesh
    end
  end

  # A specification that makes no sense. Mend the field that the message names.
  class InvalidArgument < StellateError; end
  # More than the server is willing to do. Ask for less, or raise its limit.
  class LimitExceeded < StellateError; end
  # No mesh has this name: it is misspelt, or the mesh was deleted.
  class MeshNotFound < StellateError; end
  # A call out of order, such as serving a mesh that is over.
  class FailedPrecondition < StellateError; end
  # The server wants a token, and got none that it knows.
  class Unauthenticated < StellateError; end
  # The oracle's answers break a rule, or the mesh got none. Mend the oracle.
  class OracleError < StellateError; end
  # The mesh was cancelled, from here or by somebody else.
  class Cancelled < StellateError; end
  # The server cannot be reached, or is stopping.
  class Unavailable < StellateError; end
  # No server was given, and there is no stellated on this machine to start.
  class ServerNotFound < StellateError; end
  # A mesh that the chosen file format cannot hold.
  class SaveError < StellateError; end
  # The mesh is finished and not proved good, which `require_certified` insists on.
  class NotCertified < StellateError; end

  BY_REASON = {
    'INVALID_ARGUMENT' => InvalidArgument, 'OUT_OF_ORDER' => FailedPrecondition,
    'LIMIT_EXCEEDED' => LimitExceeded, 'MESH_NOT_FOUND' => MeshNotFound,
    'FAILED_PRECONDITION' => FailedPrecondition, 'SHUTTING_DOWN' => Unavailable,
    'UNAUTHENTICATED' => Unauthenticated, 'REVISION_TOO_NEW' => InvalidArgument,
    'NO_SEEDS' => OracleError, 'NO_WORKER' => OracleError, 'ANSWER_TIMEOUT' => OracleError,
    'WORKERS_DISAGREE' => OracleError,
    'INTERNAL' => StellateError, 'JOURNAL_FULL' => StellateError,
    'JOURNAL_FAILED' => StellateError, 'REPLAY_MISMATCH' => StellateError
  }.freeze
  BY_CODE = {
    GRPC::Core::StatusCodes::INVALID_ARGUMENT => InvalidArgument,
    GRPC::Core::StatusCodes::OUT_OF_RANGE => InvalidArgument,
    GRPC::Core::StatusCodes::RESOURCE_EXHAUSTED => LimitExceeded,
    GRPC::Core::StatusCodes::NOT_FOUND => MeshNotFound,
    GRPC::Core::StatusCodes::PERMISSION_DENIED => Unauthenticated,
    GRPC::Core::StatusCodes::FAILED_PRECONDITION => FailedPrecondition,
    GRPC::Core::StatusCodes::UNAUTHENTICATED => Unauthenticated,
    GRPC::Core::StatusCodes::ABORTED => OracleError,
    GRPC::Core::StatusCodes::CANCELLED => Cancelled,
    GRPC::Core::StatusCodes::UNAVAILABLE => Unavailable,
    GRPC::Core::StatusCodes::DEADLINE_EXCEEDED => Unavailable
  }.freeze
  private_constant :BY_REASON, :BY_CODE

  DOMAIN = 'stellate.v1' # others stand between us and the server
  private_constant :DOMAIN

  # The class for one of the protocol's reasons; of a newer server's, for the code beside it.
  def self.error_class(reason, code = nil)
    return OracleError if reason.start_with?('ORACLE_')

    BY_REASON[reason] || BY_CODE.fetch(code, StellateError)
  end

  # Our error for a failed call, with the reason and the fields that the server named.
  def self.from_rpc(error)
    reason, fields, details = named_in(error.metadata['grpc-status-details-bin'])
    kind = error_class(reason, error.code)
    reason = kind.name.split('::').last if reason.empty?
    said = error.details.to_s.empty? ? reason : error.details
    said += '; give a token with credentials: Stellate::Credentials.new(token:)' if kind == Unauthenticated
    kind.new(said, reason:, fields:, details:)
  end

  def self.named_in(bytes)
    reason, fields, details = '', {}, {}
    (bytes ? Rpc::Status.decode(bytes).details : []).each do |part|
      case part.type_url.split('/').last
      when 'google.rpc.ErrorInfo'
        info = Rpc::ErrorInfo.decode(part.value)
        reason, details = info.reason, info.metadata.to_h if info.domain == DOMAIN
      when 'google.rpc.BadRequest'
        violations = Rpc::BadRequest.decode(part.value).field_violations
        fields = violations.to_h { |one| [one.field, one.description] }
      end
    end
    [reason, fields, details]
  rescue Google::Protobuf::ParseError
    ['', {}, {}] # of whatever stands between us and the server
  end
  private_class_method :named_in

  # For what a server sent that it must not send.
  def self.protocol_error(what)
    StellateError.new("the server broke the protocol: #{what}", reason: 'PROTOCOL')
  end
end
