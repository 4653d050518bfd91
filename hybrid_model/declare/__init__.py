"""What a model is: variables, transitions, automata, and what is made of them.

Authors write against this room; executions read what is declared in it. It imports nothing but `hybrid_model.errors`.
"""
