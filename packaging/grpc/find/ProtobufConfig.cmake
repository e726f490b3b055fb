# gRPC asks for a file of this name, which Debian's libprotobuf-dev lacks: CMake knows where that is.
# protoc's own library is for plugins, of which none is built.
set(Protobuf_PROTOC_LIBRARY none CACHE STRING "")
include(FindProtobuf)
