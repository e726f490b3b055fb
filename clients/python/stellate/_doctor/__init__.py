"""Is an oracle what it should be?"""
