# stellate_harden(PROGRAM): a fault of memory that came to be in spite of all is harder to make use of.
# The program lies at other addresses each time, its tables of functions are read-only once it runs, and
# nothing that can be written can be run. tests/packages/hardening_test.py looks for each.
function(stellate_harden program)
  target_link_options(${program} PRIVATE -pie -Wl,-z,relro,-z,now,-z,noexecstack)
endfunction()
